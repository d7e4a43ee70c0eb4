import { render } from 'preact';
import { browser_environment } from './live/browser';
import { LiveClient } from './live/client';
import { refresh_me } from './state/session';
import { connect, TOPICS } from './state/store';
import { App } from './ui/app';
import { on_key } from './ui/keyboard';
import './ui/theme';
import './style/tokens.css';
import './style/base.css';
import './style/shell.css';
import './style/views.css';

const client = new LiveClient(TOPICS, browser_environment());
render(<App />, document.getElementById('app')!);
addEventListener('keydown', on_key);
void refresh_me();
connect(client, () => void refresh_me());
