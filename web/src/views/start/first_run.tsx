/// No flight yet: three ways to the first one. The demonstration is flown by the server itself, through the same door as a real flight.
import { useEffect, useState } from 'preact/hooks';
import './start.css';
import { error_text } from '../../api/client';
import { idempotency_key } from '../../api/client';
import { call } from '../../api/contract';
import { may, me, of_every_site } from '../../state/session';
import { CopyBox } from '../../ui/copy_box';

const SPEED = 4; ///< times real time: a minute to the first positions of anchors

export function FirstRun() {
  const [busy, set_busy] = useState(false),
    [problem, set_problem] = useState(''),
    able = may('operator');
  useEffect(() => {
    document.title = 'First flight - anchord';
  }, []);
  const fly = async (): Promise<void> => {
    set_busy(true);
    set_problem('');
    try {
      await call('post', '/demonstration', {
        body: { speed: SPEED },
        headers: { 'Idempotency-Key': idempotency_key() },
      });
      // The flight is on the stream in a moment, and Live shows it.
    } catch (e) {
      set_problem(error_text(e));
      set_busy(false);
    }
  };
  const url = new URL('.', document.baseURI.split('#')[0]).toString().replace(/\/$/, ''),
    there = `--url ${url}` + (me.value?.auth === 'off' ? '' : ' --token-file TOKEN_FILE');
  return (
    <div class="firstrun" data-help="first" data-testid="first-run">
      <div class="start">
        <h1>No flight yet</h1>
        <p class="lead">
          {able
            ? 'Three ways to the first one. All of them work without internet.'
            : 'An operator starts the first one; this page shows it as it arrives.'}
        </p>
        {problem && (
          <div class="problem" role="alert">
            <b>The demonstration did not start.</b> {problem}
          </div>
        )}
        {able && (
          <div class="choicesbig">
            {of_every_site.value && (
              <section>
                <h2>See how it works</h2>
                <p>
                  A simulated drone flies round a building with six anchors, four times as fast as a real one. It needs
                  no hardware and takes a minute.
                </p>
                <button class="btn primary" data-testid="fly-demonstration" disabled={busy} onClick={() => void fly()}>
                  {busy ? 'Starting' : 'Fly the demonstration'}
                </button>
              </section>
            )}
            <section>
              <h2>Fly for real</h2>
              <p>
                Plug in the UWB tag and the RTK receiver. Step by step they are found, checked while they measure, and
                their radio settings compared; the guide says how to mount them.
              </p>
              <span class="rowed">
                <a class="btn primary" href="#/system/connect" data-testid="connect-devices">
                  Connect my devices
                </a>
                <a class="btn" href="#/system/flight" data-testid="first-new-flight">
                  New flight
                </a>
                <a class="btn" href="#/guide/mounting">
                  Guide
                </a>
              </span>
            </section>
            <section>
              <h2>Import a flight</h2>
              <p>
                A folder, tables (.csv) or an archive (.zip) of a flight that has already been flown. Columns with other
                names are assigned on a page.
              </p>
              <a class="btn primary" href="#/import" data-testid="import-flight">
                Import a flight
              </a>
            </section>
          </div>
        )}
        <details>
          <summary>The same on the command line</summary>
          <CopyBox text="anchord simulate flight --seed 7 --out demo-flight" />
          <CopyBox text={`anchord replay demo-flight --speed 4 ${there}`} />
          <CopyBox text={`anchord import flight DIR ${there}`} />
          {me.value?.auth !== 'off' && (
            <p>
              TOKEN_FILE has a token of the roles gateway and operator: System, Access, or{' '}
              <code>anchord token create</code> makes one.
            </p>
          )}
        </details>
      </div>
    </div>
  );
}
