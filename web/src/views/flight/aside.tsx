/// A note of the flight that is not needed to fly it: it comes in a chunk of its own, so that the operator's first load stays small.
import type { ComponentType } from 'preact';
import { useLater } from '../../ui/use_later';

type Part = ComponentType<{ mission: string }>;
export const load_devices_note = (): Promise<Part> => import('./devices_note').then((m) => m.DevicesNote);
export const load_flight_time = (): Promise<Part> => import('./flight_time').then((m) => m.FlightTime);
export const load_recording = (): Promise<Part> => import('./recording').then((m) => m.Recording);

export function Aside({ load, mission }: { load: () => Promise<Part>; mission: string }) {
  const { part: Shown } = useLater(load);
  return Shown && <Shown mission={mission} />;
}
