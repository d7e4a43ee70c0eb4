// The proof of the gateway's link: off for a while, then slow. Used by the test (seconds) and by the bench (ten minutes).
import assert from 'node:assert/strict';
import {
  Feeder,
  GatewayProcess,
  LinkProxy,
  gatewayToken,
  recordingMission,
  storedCount,
  storedNumbers,
} from './gateway.mjs';
import { eventually, startServer } from './server.mjs';

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** Age of the newest range that the server has, in seconds; null before the first. */
async function newestAge(server, mission) {
  const since = new Date(Date.now() - 60_000).toISOString();
  const answer = await server.fetch(`/api/v1/ranges?mission=${mission}&sort=-t_us&limit=1&since=${since}`);
  const { items } = await answer.json();
  return items.length > 0 ? (Date.now() * 1000 - items[0].t_us) / 1e6 : null;
}

/**
 * Rows at `rowsPerS`; the link is off for `offS` seconds, then it has `bytesPerS`. Rows go on for `onS` seconds more. Answers figures:
 * seconds until the server has a row measured after the link came back, what was sent, and the share of the link that was used.
 */
export async function linkOffThenSlow({ rowsPerS = 300, offS, bytesPerS = 32_000, onS, drainS, note = () => {} }) {
  const server = await startServer({ auth: 'on' });
  const feeder = await new Feeder().start();
  const proxy = await new LinkProxy(server.port).start();
  const gateway = new GatewayProcess({ to: proxy.url, token: await gatewayToken(server), feeder });
  try {
    const mission = await recordingMission(server);
    await gateway.start();
    await eventually('the gateway knows the mission', async () => (await gateway.status()).mission.id === mission);
    await eventually('the tag is there', () => feeder.connected);
    feeder.run(rowsPerS);
    await eventually('live rows arrive', async () => ((await newestAge(server, mission)) ?? Infinity) < 2);

    await proxy.cut();
    await sleep(offS * 1000);
    const waiting = (await gateway.status()).outbox.rows;
    note(`link off for ${offS} s: ${waiting} rows wait`);
    proxy.bytesPerS = bytesPerS;
    proxy.toServer = 0;
    await proxy.restore();
    const back = performance.now();
    await eventually(
      'a live row',
      async () => {
        const age = await newestAge(server, mission);
        return age !== null && age < (performance.now() - back) / 1000;
      },
      30_000,
      100,
    );
    const liveAfterS = (performance.now() - back) / 1000;
    note(`live ${liveAfterS.toFixed(1)} s after the link came back`);

    const ages = [];
    while (performance.now() - back < onS * 1000) {
      await sleep(500);
      ages.push((await gateway.status()).outbox.live_age_s);
    }
    const busyS = (performance.now() - back) / 1000;
    const used = proxy.toServer / busyS / bytesPerS;
    const left = (await gateway.status()).outbox.rows;
    feeder.pause();
    await eventually('all rows have left', async () => (await gateway.status()).outbox.rows === 0, drainS * 1000, 200);
    const drainedAfterS = (performance.now() - back) / 1000;
    const status = await gateway.status();
    const numbers = await storedNumbers(server, mission);
    assert.equal(numbers.length, feeder.sent.length, 'every row once');
    assert.equal(new Set(numbers).size, feeder.sent.length, 'none twice');
    assert.equal(await storedCount(server, mission), status.rows.kept);
    assert.equal(status.rows.rejected + status.rows.lost, 0);
    return {
      waiting,
      liveAfterS,
      worstLiveAgeS: Math.max(...ages),
      used,
      left,
      drainedAfterS,
      rows: feeder.sent.length,
      bytes: proxy.toServer,
    };
  } finally {
    feeder.close();
    await gateway.dispose();
    proxy.close();
    await server.dispose();
  }
}
