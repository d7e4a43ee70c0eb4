/// Every position of an anchor that was ever published, and how far each is from the one before: has it moved?
import { useEffect, useState } from 'preact/hooks';
import { past, type Past } from '../api/anchors';
import { revision } from '../state/store';
import { accuracy, date, fixed } from '../ui/format';

export function AnchorPast({ anchor }: { anchor: string }) {
  const [list, set_list] = useState<{ readonly of: string; readonly items: readonly Past[] } | null>(null);
  const newest = revision.value;
  useEffect(() => {
    past(anchor).then(
      (items) => set_list({ of: anchor, items }),
      () => set_list(null),
    );
  }, [anchor, newest]);
  if (list?.of !== anchor || !list.items.length) return null;
  return (
    <section class="sec-p" data-testid="anchor-past">
      <div class="scrollx" tabIndex={0} role="region" aria-label="Published positions">
        <table class="tbl">
          <caption>Published positions</caption>
          <thead>
            <tr>
              <th scope="col">Revision</th>
              <th scope="col">Published</th>
              <th scope="col" class="num">
                95 % h
              </th>
              <th scope="col" class="num">
                95 % v
              </th>
              <th scope="col" class="num">
                Moved h, mm
              </th>
              <th scope="col" class="num">
                v, mm
              </th>
            </tr>
          </thead>
          <tbody>
            {list.items.map((p) => (
              <tr key={p.revision}>
                <th scope="row">{p.revision}</th>
                <td>{date(p.published_at)}</td>
                <td class="num">{accuracy(p.h95_m)}</td>
                <td class="num">{accuracy(p.v95_m)}</td>
                <td class="num">{fixed(p.horizontal_m === null ? null : p.horizontal_m * 1000, 0)}</td>
                <td class="num">{fixed(p.vertical_m === null ? null : p.vertical_m * 1000, 0)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}
