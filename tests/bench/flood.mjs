// A flood of requests from a thread of its own, so that its answers do not hold up the clock of who measures beside it.
//   new Worker(new URL('./flood.mjs', import.meta.url), { workerData: { url, floods: [{ n, path, method, token, json }] } })
// Any message ends it; it answers {answered, refused}.
import { parentPort, workerData } from 'node:worker_threads';

let flooding = true,
  answered = 0,
  refused = 0;
const one = async ({ path, method = 'GET', token, json }) => {
  const headers = { authorization: `Bearer ${token}`, ...(json ? { 'content-type': 'application/json' } : {}) };
  while (flooding) {
    const answer = await fetch(workerData.url + path, { method, headers, body: json && JSON.stringify(json) }).catch(
      () => null,
    );
    await answer?.arrayBuffer().catch(() => {});
    if (answer?.ok) answered++;
    else {
      refused++;
      await new Promise((done) => setTimeout(done, 200));
    }
  }
};
const all = Promise.all(workerData.floods.flatMap((flood) => Array.from({ length: flood.n }, () => one(flood))));
parentPort.once('message', async () => {
  flooding = false;
  await Promise.race([all, new Promise((done) => setTimeout(done, 5000))]);
  parentPort.postMessage({ answered, refused });
  setTimeout(() => process.exit(0), 100);
});
