/// The place of the side elevation beside a map; what draws it comes in a chunk of its own.
import { useLater } from '../ui/use_later';
import type { Content } from './picture';

export interface ElevationProps {
  readonly content: () => Content;
  readonly onSelect: (anchor: string) => void;
  readonly version: unknown;
  readonly zero?: string | undefined; ///< what heights count from where the ground is not known
}
const load = () => import('./elevation_view').then((m) => m.default);

export function Elevation(props: ElevationProps) {
  const { part: View } = useLater(load);
  return View ? <View {...props} /> : <section class="elevation" aria-label="Side elevation" />;
}
