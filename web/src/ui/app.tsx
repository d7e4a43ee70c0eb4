import { signal } from '@preact/signals';
import { toast } from '../state/store';
import { Anchors } from '../views/anchors';
import { Live } from '../views/live';
import { AlarmBar } from './alarms';
import { Help, help_open } from './help';
import { Icon, Mark } from './marks';
import { SignIn } from './sign_in';
import { Strip } from './strip';

/// `#/live`, `#/anchors`, `#/anchors/0x6a2f`.
export const route = signal(location.hash);
addEventListener('hashchange', () => (route.value = location.hash));

function Rail({ view }: { view: 'live' | 'anchors' }) {
  const item = (id: 'live' | 'anchors', name: string) => <a class={view === id ? 'ri on' : 'ri'} href={`#/${id}`} aria-current={view === id ? 'page' : undefined} data-testid={`nav-${id}`}><Icon name={id} /><span>{name}</span></a>;
  return <nav class="rail" aria-label="Views">{item('live', 'Live')}{item('anchors', 'Anchors')}<span class="grow" /><button class="ri" onClick={() => (help_open.value = !help_open.value)} aria-expanded={help_open.value}><Icon name="help" /><span>Keys</span></button></nav>;
}

export function App() {
  const [, view, arg] = route.value.replace(/^#\/?/, '/').split('/');
  return (
    <div class="app">
      <Strip />
      <AlarmBar />
      <Rail view={view === 'anchors' ? 'anchors' : 'live'} />
      <main class="main">{view === 'anchors' ? <Anchors anchor={arg ? decodeURIComponent(arg) : null} /> : <Live />}</main>
      <SignIn />
      <Help />
      <div class="toasts" role="status">{toast.value && <div class="toast" key={toast.value.id} data-testid="toast"><Mark shape="ok" />{toast.value.text}</div>}</div>
    </div>
  );
}
