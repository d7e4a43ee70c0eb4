/// A flight that records without the devices, because another one has them: said where it is started, with the way to take them.
import { useEffect, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { devices_of, take_devices, type Devices } from '../../api/missions';
import { may } from '../../state/session';
import { devices as known, events, link, now_ms, say, scenes, tick } from '../../state/store';
import { HoldButton } from './hold_button';

const SILENT_MS = 5000; ///< rows that come by another way are measurements too
export function DevicesNote({ mission }: { mission: string }) {
  const [devices, set_devices] = useState<Devices | null>(null),
    [problem, set_problem] = useState('');
  const news =
    events.value.filter((e) => e.code.startsWith('devices.') || e.code === 'mission.finished').at(-1)?.id ?? '';
  useEffect(() => {
    let gone = false;
    devices_of(mission).then(
      (d) => {
        if (!gone) set_devices(d);
      },
      () => {
        if (!gone) set_devices(null);
      },
    ); // without an answer nothing is claimed
    return () => {
      gone = true;
    };
  }, [mission, news]);
  tick.value;
  const holder = devices?.held_by,
    scene = scenes.get(mission),
    came_ms = Math.max(scene?.range_at_ms ?? -Infinity, scene?.pose?.came_ms ?? -Infinity);
  if (!holder || !known.value.length || now_ms() - came_ms < SILENT_MS) return null;
  const take = async (): Promise<void> => {
    set_problem('');
    try {
      await take_devices(mission, holder.mission);
      say('This flight has the devices');
    } catch (e) {
      set_problem(error_text(e));
    }
  };
  return (
    <div class="callout caution" role="status" data-testid="devices-held">
      <b>No measurements from the devices.</b> {holder.name} is recording with them.
      {may('operator') && (
        <HoldButton
          testid="take-devices"
          disabled={link.value === 'lost'}
          note={`takes the devices from ${holder.name}`}
          onConfirm={() => void take()}
        >
          Take the devices
        </HoldButton>
      )}
      {problem && (
        <p class="problem" role="alert">
          {problem}
        </p>
      )}
    </div>
  );
}
