import { signal } from '@preact/signals';
import type { ComponentType } from 'preact';
import { useEffect } from 'preact/hooks';
import { of_every_site } from '../state/session';
import { current_scene, link, newer_server, tick, toast } from '../state/store';
import { flying } from '../views/flight/words';
import { load_compare, load_publish } from '../views/dialog_chunks';
import { Live } from '../views/live';
import { address_of } from './address';
import { AlarmLine } from './alarm_line';
import { Help, load_help } from './help';
import { help_open } from './help_state';
import { Icon, Mark } from './marks';
import { load_sign_in, SignIn } from './sign_in';
import { Strip } from './strip';
import { Unknown } from './unknown';
import { useLater } from './use_later';

/// `#/live`, `#/plan/<id>`, `#/anchors`, `#/anchors/0x6a2f`, `#/measurements`, `#/models`,
/// `#/models/runs/<id>?compare=<id>,<id>`, `#/replay/<mission>?t=12.5`, `#/system`; address.ts reads them.
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

function Rail({ view }: { view: View | null }) {
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
      {VIEWS.map(([id, name]) => (id !== 'models' || of_every_site.value) && item(id, name))}
      <span class="grow" />
      <button class="ri" onClick={() => (help_open.value = !help_open.value)} aria-expanded={help_open.value}>
        <Icon name="help" />
        <span>Help</span>
      </button>
    </nav>
  );
}

/// Every view but Live comes in a chunk of its own: the operator's first load stays small.
function Later<P extends object>({ load, props }: { load: () => Promise<ComponentType<P>>; props: P }) {
  const { part: View, failed, again } = useLater(load);
  if (failed && !View)
    return (
      <div class="empty">
        <h1 class="sr">Not loaded</h1>
        <p role="status">This view could not be loaded from anchord. It opens as soon as the link is back.</p>
        {link.value === 'live' && (
          <button class="btn" onClick={reload}>
            Reload
          </button>
        )}
        <button class="btn" onClick={again}>
          Try again
        </button>
      </div>
    );
  return View ? (
    <View {...props} />
  ) : (
    <div class="empty">
      <h1 class="sr">Loading</h1>
      <p role="status">
        {link.value === 'lost' ? 'This view is not loaded yet. It opens as soon as the link is back.' : 'Loading.'}
      </p>
    </div>
  );
}
const load_anchors = () => import('../views/anchors').then((m) => m.Anchors);
const load_import = () => import('../views/start/import').then((m) => m.Import);
const load_guide = () => import('../views/guide/guide').then((m) => m.Guide);
const load_models = () => import('../views/models/models').then((m) => m.Models);
const load_plan = () => import('../views/plan/plan').then((m) => m.Plan);
const load_replay = () => import('../views/replay/replay').then((m) => m.Replay);
const load_system = () => import('../views/system/system').then((m) => m.System);
const load_measurements = () => import('../views/measurements/measurements').then((m) => m.Measurements);

/// The rest of the page while nothing else is to be done: after an outage every view is there, and opens also during one.
const LATER = [
  load_sign_in,
  load_help,
  load_anchors,
  load_guide,
  load_publish,
  load_compare,
  load_replay,
  load_system,
  load_plan,
  load_measurements,
  load_models,
];
function usePrefetch(): void {
  const ready = link.value === 'live';
  useEffect(() => {
    if (!ready) return;
    let gone = false;
    const timer = setTimeout(() => void next(0), PREFETCH_AFTER_MS);
    const next = async (i: number): Promise<void> => {
      if (gone || i >= LATER.length) return;
      await LATER[i]!().catch(() => undefined);
      await new Promise((done) =>
        typeof requestIdleCallback === 'function' ? requestIdleCallback(done) : setTimeout(done, 200),
      );
      await next(i + 1);
    };
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [ready]);
}
const PREFETCH_AFTER_MS = 4000; // the first view has its data and its map by then
const reload = (): void => location.reload();

/// After an upgrade of the server. In the air it waits: nothing may tempt anybody to reload then.
function NewVersion() {
  tick.value;
  const p = current_scene()?.procedure?.value;
  if (!newer_server.value || (p && flying(p))) return null;
  return (
    <div class="toast">
      A new version is ready.
      <button class="btn small" onClick={reload}>
        Reload
      </button>
    </div>
  );
}
/// Views whose values come from the server as they are now; a recording and a draft on this device do not age.
const AGES: ReadonlySet<View> = new Set(['live', 'anchors', 'measurements', 'models', 'system']);

export function App() {
  const { page, named } = address_of(route.value),
    view: View | null = VIEWS.find(([id]) => id === page)?.[0] ?? null, // the rail shows not every page
    lost = link.value === 'lost' && view !== null && AGES.has(view);
  usePrefetch();
  return (
    <div class="app">
      <button class="skip btn primary" data-testid="skip" onClick={() => document.getElementById('main')?.focus()}>
        Skip to the view
      </button>
      <Strip />
      <AlarmLine last_known={lost} />
      <Rail view={view} />
      <main class={lost ? 'main lost' : 'main'} id="main" tabIndex={-1}>
        <div class="toasts" role="status">
          <NewVersion />
          {toast.value && (
            <div class="toast" key={toast.value.id} data-testid="toast">
              <Mark shape="ok" />
              {toast.value.text}
            </div>
          )}
        </div>
        <div class="view">
          {view === 'live' && <Live />}
          {page === null && (
            <div class="empty">
              <h1 class="sr">Not found</h1>
              <Unknown what="page" id={route.value} where="is in this dashboard">
                or choose a view from the bar.
              </Unknown>
              <a class="btn" href="#/live">
                Go to Live
              </a>
            </div>
          )}
          {page === 'import' && <Later load={load_import} props={{}} />}
          {page === 'guide' && <Later load={load_guide} props={{ page: named }} />}
          {view === 'plan' && <Later load={load_plan} props={{ id: named }} />}
          {view === 'anchors' && <Later load={load_anchors} props={{ anchor: named }} />}
          {view === 'measurements' && <Later load={load_measurements} props={{}} />}
          {view === 'replay' && <Later load={load_replay} props={{ id: named }} />}
          {view === 'system' && <Later load={load_system} props={{ part: named }} />}
          {view === 'models' && <Later load={load_models} props={{ path: named }} />}
        </div>
      </main>
      <SignIn />
      <Help />
    </div>
  );
}
