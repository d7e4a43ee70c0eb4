/// The place of the side elevation beside a map; what draws it comes in a chunk of its own.
import { useLater } from '../ui/use_later';
import type { ElevationProps } from './elevation_props';

const load = () => import('./elevation_view').then((m) => m.default);

export function Elevation(props: ElevationProps) {
  const { part: View } = useLater(load);
  return View ? <View {...props} /> : <section class="elevation" aria-label="Side elevation" />;
}
