import { render } from 'preact';

render(<main>anchord</main>, document.getElementById('app')!);
