/// Ends the recording of a flight; with control of it, where this page has that.
import { finish_flight } from '../../api/missions';
import { lease } from './lease';

export function finish(mission: string): Promise<unknown> {
  const held = lease.peek();
  return finish_flight(mission, held?.mission === mission ? held.key : null);
}
