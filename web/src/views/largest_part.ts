/// What makes the region of an anchor as large as it is, and what to do about it. No DOM.
import type { Budget } from '../api/anchors';
import { SOURCE_WORDS } from '../ui/words';

/// Empty where no budget is known.
export function largest_part(budget: Budget | null): string {
  const most = budget?.shares[0];
  if (!budget || !most) return '';
  const source = SOURCE_WORDS[most.source] ?? most.source,
    article = most.source === 'floor' ? '' : 'the ';
  return `The largest part of its uncertainty is ${article}${source} (${Math.round(most.share * 100)} %). What would help most: ${budget.help}.`;
}
