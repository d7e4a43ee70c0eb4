// The proof of the gateway's link in full: 300 rows/s, off for ten minutes, then 256 kbit/s. By name only: it takes half an hour of wall time.
import { linkOffThenSlow } from '../e2e/gateway_link.mjs';

export async function gateway(row, { offS = 600, onS = 120 } = {}) {
  const note = (text) => console.error(`    ${text}`);
  const got = await linkOffThenSlow({ rowsPerS: 300, offS, bytesPerS: 32_000, onS, drainS: 2400, note });
  row(`gateway: link off for ${offS} s at 300 rows/s`, `${got.waiting} rows waited, of ${got.rows} 0 lost, 0 twice`);
  row('gateway: live again at 256 kbit/s after', `${got.liveAfterS.toFixed(1)} s`, 'limit 10 s');
  row('gateway: oldest live row while the backlog goes', `${got.worstLiveAgeS.toFixed(1)} s`);
  row('gateway: share of the link that is used', `${(100 * got.used).toFixed(0)} %`, '100 %');
  row(
    'gateway: backlog gone after',
    `${got.drainedAfterS.toFixed(0)} s`,
    `${(got.bytes / 32_000).toFixed(0)} s of the bare link`,
  );
}
