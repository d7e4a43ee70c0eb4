/// Requests in the types of api/openapi.yaml: path, parameters, body and answer of a call are what the contract says, and nothing else compiles. What
/// speaks to the server speaks through here: fetch itself is this file's alone (eslint.config.js).
import { ApiError, problem_of } from './client';
import type { components, paths } from './generated/schema';

/// A schema of the contract by its name.
export type Wire<Name extends keyof components['schemas']> = components['schemas'][Name];

type Root = '/api/v1';
type Verb = 'get' | 'post' | 'put' | 'patch' | 'delete';
type Operation<P extends string, M extends Verb> = `${Root}${P}` extends keyof paths ? paths[`${Root}${P}`][M] : never;
/// Paths that know the method, without what all of them begin with.
export type Path<M extends Verb> = {
  [P in keyof paths]: P extends `${Root}${infer Rest}` ? (paths[P] extends Record<M, object> ? Rest : never) : never;
}[keyof paths];

/// GeoJSON where there is a choice: the other JSON is a file that is asked for by `format`.
type Json<R> = R extends { content: { 'application/geo+json': infer B } }
  ? B
  : R extends { content: { 'application/json': infer B } }
    ? B
    : never;
type Responses<O> = O extends { responses: infer R } ? R : never;
/// 202 is left out: who asks for a job's answer at once says `Prefer: wait`, and looks at what came.
type Good<O> = Json<Responses<O>[keyof Responses<O> & (200 | 201)]>;

type JsonType = 'application/json' | 'application/merge-patch+json';
type Content<O> = O extends { requestBody?: infer B }
  ? NonNullable<B> extends { content: infer C }
    ? C
    : never
  : never;
type FileType<O> = keyof Content<O> & string;
/// A body that is no JSON of ours: rows as lines, a file as it was chosen.
interface File<Type extends string> {
  readonly type: Type;
  readonly data: string | Blob;
}
interface Optional<O> {
  readonly query?: O extends { parameters: { query?: infer Q } } ? NonNullable<Q> : never;
  readonly headers?: Record<string, string>;
}
type Places<O> = O extends { parameters: { path: infer P } } ? { readonly path: P } : { readonly path?: never };
type Body<O> = O extends { requestBody: object }
  ? | { readonly body: Content<O>[keyof Content<O> & JsonType]; readonly file?: never }
    | { readonly file: File<FileType<O>>; readonly body?: never }
  : { readonly body?: Content<O>[keyof Content<O> & JsonType]; readonly file?: never };
type Ask<O> = Optional<O> & Places<O> & Body<O>;
type Where<O> = Optional<O> & Places<O>;
/// Left out altogether where nothing of it must be said.
type Args<A> = object extends A ? [ask?: A] : [ask: A];

/// Without what is not said (null, undefined, an empty text). A name that the contract does not have would compile in a spread, and does not here.
export const given = <T extends object>(all: NoInfer<{ readonly [K in keyof T]: T[K] | null | undefined | '' }>): T =>
  Object.fromEntries(Object.entries(all).filter(([, v]) => v !== null && v !== undefined && v !== '')) as T;

type Value = string | number | boolean;
interface Loose {
  readonly path?: object;
  readonly query?: object;
  readonly body?: unknown;
  readonly file?: File<string>;
  readonly headers?: Record<string, string>;
}

/// `/plans/{id}` and { id: 'a b' } -> `/plans/a%20b`; a query value that is absent is left out.
export function address(path: string, parts: object = {}, query: object = {}): string {
  const filled = path.replace(/\{(\w+)\}/g, (_, name: string) =>
    encodeURIComponent(String((parts as Record<string, Value>)[name])),
  );
  const asked = new URLSearchParams();
  for (const [key, value] of Object.entries(query) as [string, Value | null | undefined][])
    if (value !== undefined && value !== null) asked.set(key, String(value));
  return asked.size ? `${filled}?${asked}` : filled;
}
const of_this_server = (path: string): string => new URL(path, document.baseURI.split('#')[0]).toString();
/// Where a GET of the contract is, for links, pictures and downloads.
export function url<P extends Path<'get'>>(path: P, ...[ask]: Args<Where<Operation<P, 'get'>>>): string {
  const { path: parts, query } = (ask ?? {}) as Loose;
  return of_this_server(`api/v1${address(path, parts, query)}`);
}

async function fetched(
  method: string,
  path: string,
  { path: parts, query, body, file, headers }: Loose,
): Promise<Response> {
  const sent = file?.data ?? (body === undefined ? undefined : JSON.stringify(body));
  try {
    return await fetch(of_this_server(`api/v1${address(path, parts, query)}`), {
      method,
      credentials: 'same-origin',
      cache: 'no-cache',
      headers: {
        Accept: 'application/json, application/geo+json, application/problem+json',
        'X-Anchord': '1',
        ...(sent === undefined ? {} : { 'Content-Type': file?.type ?? 'application/json' }),
        ...headers,
      },
      ...(sent === undefined ? {} : { body: sent }),
    });
  } catch {
    throw new ApiError(problem_of(null, 0));
  }
}
/// `etag` names the state that was read; sent back as If-Match, a change of another state is refused.
export interface Answered<T> {
  readonly body: T;
  readonly etag: string;
}
async function exchange(method: string, path: string, ask: unknown): Promise<Answered<unknown>> {
  const answer = await fetched(method, path, ask ?? {}),
    text = await answer.text();
  let parsed: unknown = null;
  try {
    parsed = text ? JSON.parse(text) : null;
  } catch {
    // A page where JSON was asked for is of somebody on the way, such as the sign-in of a guest network.
    if (answer.ok) throw new ApiError(problem_of(null, 0));
  }
  if (!answer.ok) throw new ApiError(problem_of(parsed, answer.status), parsed);
  return { body: parsed, etag: answer.headers.get('etag') ?? '' };
}

type AskOf<P extends Path<M>, M extends Verb> = Ask<Operation<P, M>>;
type GoodOf<P extends Path<M>, M extends Verb> = Good<Operation<P, M>>;
type Rows<Page> = Page extends { items?: infer I } ? NonNullable<I> : never;

export const call = async <M extends Verb, P extends Path<M>>(
  method: M,
  path: P,
  ...[ask]: Args<AskOf<P, M>>
): Promise<Answered<GoodOf<P, M>>> => (await exchange(method.toUpperCase(), path, ask)) as Answered<GoodOf<P, M>>;
export const get = async <P extends Path<'get'>>(
  path: P,
  ...[ask]: Args<Where<Operation<P, 'get'>>>
): Promise<GoodOf<P, 'get'>> => (await exchange('GET', path, ask)).body as GoodOf<P, 'get'>;
/// The rows of a page.
export const list = async <P extends Path<'get'>>(
  path: P,
  ...[ask]: Args<Where<Operation<P, 'get'>>>
): Promise<Rows<GoodOf<P, 'get'>>> =>
  ((await exchange('GET', path, ask)).body as { readonly items: Rows<GoodOf<P, 'get'>> }).items;
/// What is no JSON, as it comes: a picture. A refusal is not thrown.
export const bytes = <P extends Path<'get'>>(path: P, ...[ask]: Args<Where<Operation<P, 'get'>>>): Promise<Response> =>
  fetched('GET', path, { ...((ask ?? {}) as Loose), headers: { Accept: '*/*' } });

/// Outside /api/v1: what the program says of itself, and whatever of it where it is not well (503).
export async function of_program<P extends '/version' | '/readyz'>(path: P): Promise<Good<paths[P]['get']>> {
  const answer = await fetch(of_this_server(path.slice(1)), { credentials: 'same-origin', cache: 'no-cache' });
  return (await answer.json()) as Good<paths[P]['get']>;
}
