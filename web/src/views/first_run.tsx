import { useEffect } from 'preact/hooks';
import { CopyBox } from '../ui/copy_box';

/// No flight yet: one sentence why, and the one thing to do.
export function FirstRun() {
  useEffect(() => {
    document.title = 'First flight - anchord';
  }, []);
  const url = new URL('.', document.baseURI.split('#')[0]).toString().replace(/\/$/, '');
  return (
    <div class="firstrun" data-testid="first-run">
      <div>
        <h1>Fly a simulated flight first</h1>
        <p class="lead">
          This server holds no flight yet. A simulated one needs no hardware and no internet: it comes in through the
          same door as a real one, so what you see is what you will fly.
        </p>
        <ol>
          <li>
            <b>1</b>
            <div>
              <h2>Make the flight</h2>
              <p>A building with anchors inside, a drone with RTK around it.</p>
              <CopyBox text="anchord simulate flight --seed 7 --out demo-flight" />
            </div>
          </li>
          <li>
            <b>2</b>
            <div>
              <h2>Play it into this server</h2>
              <p>This page shows it as it arrives; nothing needs to be reloaded.</p>
              <CopyBox text={`anchord replay demo-flight --url ${url} --speed 4`} />
            </div>
          </li>
        </ol>
        <p class="mut">
          Have a recorded flight? <code>anchord import flight DIR</code> takes its folder: flight.json, track and
          ranges.
        </p>
      </div>
    </div>
  );
}
