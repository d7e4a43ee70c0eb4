/// Help: what is on the screen in words, and the keys. A chunk of its own.
import { useState } from 'preact/hooks';
import { help_open, keys_on, set_keys } from './help_state';
import { Icon } from './marks';
import { useLater } from './use_later';
import { help_of_dialog, useDialog } from './use_dialog';

const KEYS: readonly [string, string][] = [
  ['1', 'Live'],
  ['2', 'Plan'],
  ['3', 'Anchors'],
  ['4', 'Measurements'],
  ['5', 'Models'],
  ['6', 'Replay'],
  ['7', 'System'],
  ['J K', 'next, previous measurement'],
  ['Space ← → , .', 'play, step, previous and next event in a replay'],
  ['[ ]', 'previous, next anchor'],
  ['C', 'follow the drone'],
  ['F', 'fit everything'],
  ['+ −', 'zoom the map'],
  ['arrows', 'move the map, when it has the focus'],
  ['/', 'filter anchors'],
  ['H', 'hold the aircraft, in flight'],
  ['T', 'next theme'],
  ['M', 'mute 2 minutes'],
  ['A', 'acknowledge the first alarm'],
  ['?', 'help for what is on the screen'],
  ['Esc', 'close'],
];
const load_guide = () => import('../views/guide/guide').then((m) => m.GuideSheet);
/// The page for what is on the screen: of the newest dialog, of the part that has the focus, of what is opened within the view; else of the view.
function page_on_screen(): string {
  const part = document.activeElement?.closest<HTMLElement>('[data-help], [data-help-part]'),
    opened = [...document.querySelectorAll<HTMLElement>('main [data-help]')].at(-1);
  return help_of_dialog() ?? part?.dataset.help ?? part?.dataset.helpPart ?? opened?.dataset.help ?? location.hash;
}
/// What is on the screen, in words: the guide's page for it.
function ScreenHelp({ close }: { close: () => void }) {
  const { part: Sheet } = useLater(load_guide),
    [page] = useState(page_on_screen);
  return Sheet ? <Sheet page={page} close={close} /> : null;
}

export function HelpSheet() {
  const box = useDialog<HTMLElement>(() => (help_open.value = false), 'help');
  return (
    <section class="sheet" {...box} aria-labelledby="help-title" data-testid="help">
      <div class="hd">
        <h2 id="help-title">Help</h2>
        <button class="btn quiet small" aria-label="Close" onClick={() => (help_open.value = false)}>
          <Icon name="close" />
        </button>
      </div>
      <ScreenHelp close={() => (help_open.value = false)} />
      <h3>Keys</h3>
      <dl class="keys">
        {KEYS.map(([k, what]) => (
          <div key={k}>
            <dt>
              <kbd>{k}</kbd>
            </dt>
            <dd>{what}</dd>
          </div>
        ))}
      </dl>
      <label class="check">
        <input
          type="checkbox"
          checked={keys_on.value}
          onChange={(e) => {
            set_keys(e.currentTarget.checked);
          }}
        />{' '}
        Single-letter keys are on
      </label>
      <p class="mut">σ is one sigma and says so; ellipses and ± are 95 %. GDOP is the square root of the trace.</p>
    </section>
  );
}
