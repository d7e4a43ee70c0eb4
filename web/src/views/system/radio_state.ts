/// How a radio stands in the flights that are being recorded: by what arrives now, not by what was once in range. No DOM.
import type { Scene } from '../../state/scene';

export type RadioState = 'live' | 'late' | 'lost' | 'not in this flight' | 'no flight';
const LATE_MS = 5000,
  LOST_MS = 30_000;

export function radio_state(id: string, recording: readonly Scene[], now_ms: number): RadioState {
  if (!recording.length) return 'no flight';
  let at_ms = -Infinity,
    known = false;
  for (const scene of recording) {
    known ||= scene.anchors.has(id);
    for (const [anchor, row] of scene.ranges)
      if (anchor === id || row.last.tag === id) at_ms = Math.max(at_ms, row.at_ms);
  }
  if (at_ms === -Infinity) return known ? 'lost' : 'not in this flight';
  const silence = now_ms - at_ms;
  return silence > LOST_MS ? 'lost' : silence > LATE_MS ? 'late' : 'live';
}
