/// Requests in the types of api/openapi.yaml: path, parameters, body and answer of a call are what the contract says, and nothing else compiles.
import { exchange } from './client';
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

type Json<R> = R extends { content: { 'application/json': infer B } }
  ? B
  : R extends { content: { 'application/geo+json': infer B } }
    ? B
    : never;
type Responses<O> = O extends { responses: infer R } ? R : never;
/// 202 is left out: who asks for a job's answer at once says `Prefer: wait`, and looks at what came.
type Good<O> = Json<Responses<O>[keyof Responses<O> & (200 | 201)]>;
type Content<O> = O extends { requestBody?: infer B } ? (B extends { content: infer C } ? C[keyof C] : never) : never;
type Parameters<O, Where extends 'path' | 'query'> = O extends { parameters: infer A }
  ? Where extends keyof A
    ? NonNullable<A[Where]>
    : unknown
  : unknown;

interface Ask<O> {
  readonly path?: Parameters<O, 'path'>;
  readonly query?: Parameters<O, 'query'>;
  readonly body?: Content<O>;
  readonly headers?: Record<string, string>;
}

type Value = string | number | boolean;
interface Loose {
  readonly path?: object;
  readonly query?: object;
  readonly body?: unknown;
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

export interface Answered<T> {
  readonly body: T;
  readonly etag: string;
}
type AskOf<P extends Path<M>, M extends Verb> = Ask<Operation<P, M>>;
type GoodOf<P extends Path<M>, M extends Verb> = Good<Operation<P, M>>;
type Rows<Page> = Page extends { items?: infer I } ? NonNullable<I> : never;

export async function call<M extends Verb, P extends Path<M>>(
  method: M,
  path: P,
  ask?: AskOf<P, M>,
): Promise<Answered<GoodOf<P, M>>> {
  const { path: parts, query, body, headers } = (ask ?? {}) as Loose;
  const answer = await exchange(method.toUpperCase(), address(path, parts, query), body, headers);
  return answer as Answered<GoodOf<P, M>>;
}
export async function get<P extends Path<'get'>>(path: P, ask?: AskOf<P, 'get'>): Promise<GoodOf<P, 'get'>> {
  const { path: parts, query, headers } = (ask ?? {}) as Loose;
  return (await exchange('GET', address(path, parts, query), undefined, headers)).body as GoodOf<P, 'get'>;
}
/// The rows of a page.
export async function list<P extends Path<'get'>>(path: P, ask?: AskOf<P, 'get'>): Promise<Rows<GoodOf<P, 'get'>>> {
  const { path: parts, query, headers } = (ask ?? {}) as Loose;
  const { body } = await exchange('GET', address(path, parts, query), undefined, headers);
  return (body as { readonly items: Rows<GoodOf<P, 'get'>> }).items;
}
