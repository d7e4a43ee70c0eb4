// A program as an integrator writes it: the types are generated from the contract, openapi-fetch sends. It must compile without a
// cast, so that what the contract says is what a client can use. Prints what clients.test.mjs expects, as JSON.
import createClient from 'openapi-fetch';
import type { paths } from './schema';

const [url, token] = process.argv.slice(2);
if (!url || !token) throw new Error('usage: client URL TOKEN');
const client = createClient<paths>({ baseUrl: url, headers: { Authorization: `Bearer ${token}` } });

const made = await client.POST('/api/v1/missions', {
  params: { query: { devices: false } },
  body: { name: 'from a generated client', frame: 'wgs84', track_point: 'gnss_antenna', tags: [] },
});
if (!made.data) throw new Error(JSON.stringify(made.error));
const mission = made.data.id;

const range = { t_us: 1_777_889_472_345_678, tag: '0x6e01', anchor: '0x6a2f', distance_m: 7.412, mission };
const sent = await client.POST('/api/v1/ranges', { body: [range, { ...range, seq: 2, distance_m: 7.5 }] });
const counts = sent.data && { accepted: sent.data.accepted, rejected: sent.data.rejected };

// Refused rows come as a problem; its counts are typed too, once it is known which form it has.
const bad = await client.POST('/api/v1/ranges', { body: [{ ...range, distance_m: 0 }] });
const problem = bad.error;
const rejected = problem && 'rejected' in problem ? problem.rejected : null;

// CSV and NDJSON come from the same address, so that an answer may be text.
const listed = await client.GET('/api/v1/ranges', { params: { query: { mission, limit: 10 } } });
const anchors = await client.GET('/api/v1/anchors');
const absent = await client.GET('/api/v1/missions/{id}', {
  params: { path: { id: '0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f' } },
});

console.log(
  JSON.stringify({
    counts,
    refused: { status: bad.response.status, type: problem?.type, rejected },
    distances:
      typeof listed.data === 'object' && 'items' in listed.data ? listed.data.items.map((row) => row.distance_m) : null,
    anchors: typeof anchors.data === 'object' && 'features' in anchors.data ? anchors.data.features.length : null,
    absent: { status: absent.response.status, title: absent.error?.title, detail: absent.error?.detail },
  }),
);
