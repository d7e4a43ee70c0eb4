import { help_open } from './help_state';
import { useLater } from './use_later';

export const load_help = () => import('./help_sheet').then((m) => m.HelpSheet);
function Sheet() {
  const { part: HelpSheet } = useLater(load_help);
  return HelpSheet ? <HelpSheet /> : null;
}
export const Help = () => (help_open.value ? <Sheet /> : null);
