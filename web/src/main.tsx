import { effect } from '@preact/signals';
import { render } from 'preact';
import { browser_environment } from './live/browser';
import { LiveClient } from './live/client';
import { follow_archive, load_missions } from './state/archive';
import { pace_components } from './state/pace';
import { me, refresh_me } from './state/session';
import { connect, PARAMS, TOPICS } from './state/store';
import { App } from './ui/app';
import { on_key } from './ui/keyboard';
import './ui/theme';
import './style/tokens.css';
import './style/base.css';
import './style/shell.css';
import './style/strip.css';
import './style/alarm.css';
import './style/live.css';
import './style/anchors.css';

const client = new LiveClient(TOPICS, browser_environment(), PARAMS);
pace_components();
render(<App />, document.getElementById('app')!);
addEventListener('keydown', on_key);
// A file that is dropped beside its place would be opened instead of this page, in flight too.
for (const kind of ['dragover', 'drop'] as const)
  addEventListener(kind, (e) => {
    if (e.dataTransfer?.types.includes('Files')) e.preventDefault();
  });
/// Signed out, the stream rests until somebody signs in; the last picture stays.
let started = false;
void refresh_me().then(() =>
  effect(() => {
    if (me.value === null) return client.pause();
    if (!started) {
      connect(
        client,
        () => void refresh_me(),
        () => void load_missions(),
      );
      follow_archive();
    }
    started = true;
  }),
);
