/// Failures of REST: each is an ApiError that carries a problem (RFC 9457), so a view can show title, detail and request id.
import { num, obj, str } from '../live/messages';

export interface FieldProblem {
  readonly pointer: string;
  readonly detail: string;
}
export interface Problem {
  readonly type: string;
  readonly title: string;
  readonly status: number;
  readonly detail: string;
  readonly request_id: string;
  readonly errors: readonly FieldProblem[];
}
export class ApiError extends Error {
  /// `body`: all that came, where a problem carries more than its own members.
  constructor(
    readonly problem: Problem,
    readonly body: unknown = null,
  ) {
    super(`${problem.title}${problem.detail ? `: ${problem.detail}` : ''}`);
  }
}

/// What was asked for is not there (any more), or its name can be none.
export const is_unknown = (e: unknown): boolean =>
  e instanceof ApiError && [400, 404, 410, 422].includes(e.problem.status);

export function problem_of(body: unknown, status: number): Problem {
  const o = obj(body);
  const errors = Array.isArray(o?.errors)
    ? o.errors
        .map(obj)
        .filter((e) => e !== null)
        .map((e) => ({ pointer: str(e.pointer), detail: str(e.detail) }))
    : [];
  return {
    type: str(o?.type),
    title: str(o?.title) || (status ? `The server answered ${status}` : 'No answer from anchord'),
    status: num(o?.status) ?? status,
    detail: str(o?.detail),
    request_id: str(o?.request_id),
    errors,
  };
}

/// What is wrong with each field, where the problem's own words do not say it already; the first five.
function field_texts({ errors, detail }: Problem): string {
  const more = errors
    .filter((e) => e.detail && !detail.includes(e.detail))
    .slice(0, 5)
    .map((e) => `${e.pointer.replace(/^\//, '').replaceAll('/', ' ')} ${e.detail}`.trim());
  return more.length ? `: ${more.join('; ')}` : '';
}
/// A failure in the words of the server, with the number under which its log has it.
export const error_text = (e: unknown): string =>
  e instanceof ApiError
    ? `${e.message}${field_texts(e.problem)}${e.problem.request_id ? ` (request ${e.problem.request_id})` : ''}`
    : e instanceof Error
      ? e.message
      : String(e);

/// One try per press of a button, even if the answer is lost on the way: the server keeps the first result under the key.
export const idempotency_key = (): string =>
  Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => b.toString(16).padStart(2, '0')).join('');
