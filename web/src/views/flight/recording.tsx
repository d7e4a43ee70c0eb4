/// Where the recording of the shown flight is ended, what became of it then, and the way to the next one.
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { may } from '../../state/session';
import { current_mission, current_scene, link, say, tick } from '../../state/store';
import { Problem } from '../../ui/problem';
import { AfterLanding } from './after_landing';
import { finish } from './finish';
import { HoldButton } from './hold_button';
import { flying } from './words';

export function Recording({ mission }: { mission: string }) {
  tick.value;
  const m = current_mission.value,
    p = current_scene()?.procedure?.value;
  if (m?.mission !== mission || (p && flying(p))) return null;
  return (
    <>
      <AfterLanding mission={mission} />
      {may('operator') && (
        <section class="sec-p" data-testid="recording">
          {m.state === 'recording' ? (
            <Finish key={mission} mission={mission} name={m.name} />
          ) : (
            <a class="btn small" href="#/system/flight" data-testid="next-flight">
              New flight
            </a>
          )}
        </section>
      )}
    </>
  );
}

function Finish({ mission, name }: { mission: string; name: string }) {
  const [problem, set_problem] = useState('');
  const confirmed = async (): Promise<void> => {
    set_problem('');
    try {
      await finish(mission);
      say(`${name || 'The flight'} is finished`);
    } catch (e) {
      set_problem(error_text(e));
    }
  };
  return (
    <>
      <HoldButton
        testid="finish-recording"
        disabled={link.value === 'lost'}
        note="hold 1 s"
        onConfirm={() => void confirmed()}
      >
        Finish the recording
      </HoldButton>
      <Problem text={problem} />
    </>
  );
}
