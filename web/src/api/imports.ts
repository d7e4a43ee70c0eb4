/// A flight into this server, as a mission of its own that is finished when all rows are in.
import { ApiError, idempotency_key } from './client';
import { call, type Answered, type Wire } from './contract';
import { count, elements, num, obj, str, type Unchecked } from '../live/messages';

const BATCH = 5000; ///< rows in a request: some hundred kilobytes
export interface Sent {
  readonly mission: string;
  readonly accepted: number;
  readonly rejected: number;
  readonly first_reason: string;
  readonly unnamed: number; ///< anchors whose names could not be kept
}

/// What became of rows. Where not one was taken it comes as a problem (422) with the same members.
export async function row_report(
  sending: Promise<Pick<Answered<Unchecked<Wire<'IngestAnswer'>>>, 'body'>>,
): Promise<Unchecked<Wire<'IngestAnswer'>>> {
  try {
    return (await sending).body;
  } catch (e) {
    const refused = e instanceof ApiError ? (e.body as Unchecked<Wire<'IngestProblem'>>) : null;
    if (num(obj(refused)?.rejected) !== null) return refused;
    throw e;
  }
}

type Place = readonly [number, number, number];
/// Places of another system as longitude, latitude and ellipsoidal height; `what` says from what to what, in words.
export async function on_globe(
  places: readonly Place[],
  source: { readonly crs: string; readonly heights: string },
): Promise<{ readonly places: readonly Place[]; readonly what: string }> {
  const out: Place[] = [];
  let what = '';
  for (let i = 0; i < places.length; i += BATCH) {
    const { body } = await call('post', '/transform', {
      body: { from: 'crs', to: 'geo', ...source, points: places.slice(i, i + BATCH).map((p) => [...p]) },
    });
    out.push(...body.points.map((p) => [p[0]!, p[1]!, p[2]!] as const));
    const s = body.source;
    if (s && !what)
      what =
        `positions from ${s.name} to ${s.datum}, heights ${s.heights}` +
        (s.datum_error_m > 0 ? `, error of the datum ${s.datum_error_m} m` : '');
  }
  return { places: out, what };
}

/// `progress`: share of the rows that are in. Stopping leaves what is in, and an unfinished mission is finished.
export async function send_flight(
  mission: Wire<'MissionCreate'>,
  fixes: readonly object[],
  ranges: readonly object[],
  names: ReadonlyMap<string, string>,
  progress: (share: number) => void,
): Promise<Sent> {
  const { body } = await call('post', '/missions', {
    query: { devices: false },
    body: mission,
    headers: { 'Idempotency-Key': idempotency_key() },
  });
  let accepted = 0,
    rejected = 0,
    done = 0,
    first_reason = '';
  try {
    // A range waits on the server for the position after it.
    for (const [path, rows] of [
      ['/fixes', fixes],
      ['/ranges', ranges],
    ] as const)
      for (let i = 0; i < rows.length; i += BATCH) {
        const part = rows.slice(i, i + BATCH),
          answer = obj(
            await row_report(
              call('post', path, {
                query: { mission: body.id },
                file: { type: 'application/x-ndjson', data: part.map((r) => JSON.stringify(r)).join('\n') + '\n' },
                headers: { 'Idempotency-Key': idempotency_key() },
              }),
            ),
          );
        accepted += count(answer?.accepted);
        rejected += count(answer?.rejected);
        const first = obj(elements(answer?.errors)[0]);
        first_reason ||= str(first?.detail) || str(first?.code);
        progress((done += part.length) / (fixes.length + ranges.length));
      }
  } finally {
    await call('post', '/missions/{id}/actions', {
      path: { id: body.id },
      body: { action: 'finish' },
      headers: { 'Idempotency-Key': idempotency_key() },
    });
  }
  return { mission: body.id, accepted, rejected, first_reason, unnamed: await name_anchors(names) };
}

/// Names that the files have for anchors, where a person has given none here. How many could not be kept.
async function name_anchors(names: ReadonlyMap<string, string>): Promise<number> {
  let unnamed = 0;
  for (const [id, name] of names) {
    try {
      const { body, etag } = await call('get', '/anchors/{id}', { path: { id } });
      if (body.properties.name) continue;
      await call('patch', '/anchors/{id}', { path: { id }, body: { name }, headers: { 'If-Match': etag } });
    } catch {
      unnamed++;
    }
  }
  return unnamed;
}
