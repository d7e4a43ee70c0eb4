import { signal } from '@preact/signals';
import type { ComponentType } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { toast } from '../state/store';
import { Anchors } from '../views/anchors';
import { Live } from '../views/live';
import { AlarmBar } from './alarms';
import { Help, help_open } from './help';
import { Icon, Mark } from './marks';
import { SignIn } from './sign_in';
import { Strip } from './strip';
import { useStable } from './use_stable';

/// `#/live`, `#/plan/<id>`, `#/anchors`, `#/anchors/0x6a2f`, `#/measurements`, `#/models`,
/// `#/models/runs/<id>?compare=<id>,<id>`, `#/replay/<mission>?t=12.5`, `#/system`.
export const route = signal(location.hash);
addEventListener('hashchange', () => (route.value = location.hash));

const VIEWS = [
  ['live', 'Live'],
  ['plan', 'Plan'],
  ['anchors', 'Anchors'],
  ['measurements', 'Measure'],
  ['models', 'Models'],
  ['replay', 'Replay'],
  ['system', 'System'],
] as const;
type View = (typeof VIEWS)[number][0];

function Rail({ view }: { view: View }) {
  const item = (id: View, name: string) => (
    <a
      key={id}
      class={view === id ? 'ri on' : 'ri'}
      href={`#/${id}`}
      aria-current={view === id ? 'page' : undefined}
      data-testid={`nav-${id}`}
    >
      <Icon name={id} />
      <span>{name}</span>
    </a>
  );
  return (
    <nav class="rail" aria-label="Views">
      {VIEWS.map(([id, name]) => item(id, name))}
      <span class="grow" />
      <button class="ri" onClick={() => (help_open.value = !help_open.value)} aria-expanded={help_open.value}>
        <Icon name="help" />
        <span>Keys</span>
      </button>
    </nav>
  );
}

/// A view that is not for the field comes in a chunk of its own: the operator's first load stays small.
function Later<P extends object>({ load, props }: { load: () => Promise<ComponentType<P>>; props: P }) {
  const [View, set_view] = useState<ComponentType<P> | null>(null),
    [failed, set_failed] = useState(false);
  const begin = useStable(load);
  useEffect(() => {
    begin().then(
      (v) => set_view(() => v),
      () => set_failed(true),
    );
  }, [begin]);
  if (failed)
    return (
      <div class="empty">
        <p role="status">This view could not be loaded from anchord. It needs the link to the server once.</p>
      </div>
    );
  return View ? (
    <View {...props} />
  ) : (
    <div class="empty">
      <p role="status">Loading.</p>
    </div>
  );
}
const load_models = () => import('../views/models/models').then((m) => m.Models);
const load_plan = () => import('../views/plan/plan').then((m) => m.Plan);
const load_replay = () => import('../views/replay/replay').then((m) => m.Replay);
const load_system = () => import('../views/system/system').then((m) => m.System);
const load_measurements = () => import('../views/measurements/measurements').then((m) => m.Measurements);

export function App() {
  const [, name, ...args] = route.value.replace(/^#\/?/, '/').split('/'),
    arg = args[args.length - 1];
  const view: View = VIEWS.find(([id]) => id === name)?.[0] ?? 'live',
    named = arg ? decodeURIComponent(arg) : null;
  return (
    <div class="app">
      <Strip />
      <AlarmBar />
      <Rail view={view} />
      <main class="main">
        {view === 'live' && <Live />}
        {view === 'plan' && <Later load={load_plan} props={{ id: named }} />}
        {view === 'anchors' && <Anchors anchor={named} />}
        {view === 'measurements' && <Later load={load_measurements} props={{}} />}
        {view === 'replay' && <Later load={load_replay} props={{ id: named }} />}
        {view === 'system' && <Later load={load_system} props={{}} />}
        {view === 'models' && <Later load={load_models} props={{ path: args[0] === 'runs' ? named : null }} />}
      </main>
      <SignIn />
      <Help />
      <div class="toasts" role="status">
        {toast.value && (
          <div class="toast" key={toast.value.id} data-testid="toast">
            <Mark shape="ok" />
            {toast.value.text}
          </div>
        )}
      </div>
    </div>
  );
}
