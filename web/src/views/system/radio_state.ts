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

/// The server lists a radio once for every flight it was in range in; on the screen it is one radio, as it was last seen.
export function last_seen_of_each<
  R extends { readonly network_id: string | null; readonly last_seen_us: number | null },
>(radios: readonly R[]): R[] {
  const newest = new Map<string | null, R>();
  for (const r of radios) {
    const before = newest.get(r.network_id);
    if (!before || (r.last_seen_us ?? 0) > (before.last_seen_us ?? 0)) newest.set(r.network_id, r);
  }
  return [...newest.values()].sort((a, b) => (b.last_seen_us ?? 0) - (a.last_seen_us ?? 0));
}
