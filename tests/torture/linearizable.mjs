// Whether a history of calls could have happened one call after the other, each at some moment between its start and its end (Herlihy and
// Wing, 1990): the search of Wing and Gong with Lowe's memory of what was tried.
//
// An operation: {key, call, end, input, output}; `call` and `end` of one clock. A call whose outcome nobody knows (time-out, connection
// lost, 503) has no output and no end: it took effect at any time after its start, or never. A model: {initial, step(state, input, output)}
// answers the state after it, or undefined where that output is impossible in that state; states are compared as JSON.

const k_most_states = 1_000_000;

/** {linearizable: true}, or {linearizable: false, longest, open}: the longest order that was possible, and what fits nowhere behind it. */
export function checkKey(operations, model) {
  const ops = [...operations].sort((a, b) => a.call - b.call),
    end = (op) => (op.output === undefined ? Infinity : op.end),
    known = ops.filter((op) => op.output !== undefined).length,
    tried = new Set(),
    asked = ops.map(({ input }) => JSON.stringify(input)),
    done = new Array(ops.length).fill(false),
    order = [];
  let longest = [],
    first = 0; // all before it are done
  // What stands behind `first` tells two sets of done operations apart.
  const position = (state) => {
    let last = done.length;
    while (last > first && !done[last - 1]) --last;
    return `${first}|${done.slice(first, last).map(Number).join('')}|${JSON.stringify(state)}`;
  };
  // Who begins after another one's end comes after it. Those of unknown outcome last, and of several that ask for the same the earliest
  // alone: whatever order has a later one has it in its place too.
  const candidates = () => {
    let before = Infinity;
    const sure = [],
      unsure = new Map();
    for (let i = first; i < ops.length && ops[i].call <= before; i++)
      if (!done[i]) before = Math.min(before, end(ops[i]));
    for (let i = first; i < ops.length && ops[i].call <= before; i++) {
      if (done[i]) continue;
      if (ops[i].output !== undefined) sure.push(i);
      else if (!unsure.has(asked[i])) unsure.set(asked[i], i);
    }
    return [...sure, ...unsure.values()];
  };
  const search = (state, left) => {
    if (left === 0) return true;
    const at = position(state);
    if (tried.has(at)) return false;
    tried.add(at);
    if (tried.size > k_most_states)
      throw new Error(`a history of ${ops.length} calls is not decided within ${k_most_states} states`);
    for (const i of candidates()) {
      const unknown = ops[i].output === undefined,
        next = model.step(state, ops[i].input, ops[i].output);
      // One of unknown outcome that changes nothing might as well never have come.
      if (next === undefined || (unknown && JSON.stringify(next) === JSON.stringify(state))) continue;
      const before_it = first;
      done[i] = true;
      order.push(ops[i]);
      while (done[first]) ++first;
      if (order.length > longest.length) longest = [...order];
      if (search(next, left - (unknown ? 0 : 1))) return true;
      first = before_it;
      done[i] = false;
      order.pop();
    }
    return false;
  };
  if (search(model.initial, known)) return { linearizable: true };
  const there = new Set(longest);
  return { linearizable: false, longest, open: ops.filter((op) => !there.has(op) && op.output !== undefined) };
}

/** Keys are independent of one another; `modelOf(key)`. Of each history that is not linearizable: {key, longest, open}. */
export function violations(operations, modelOf) {
  const keys = new Map();
  for (const op of operations) keys.set(op.key, [...(keys.get(op.key) ?? []), op]);
  return [...keys].flatMap(([key, ops]) => {
    const found = checkKey(ops, modelOf(key));
    return found.linearizable ? [] : [{ key, ...found }];
  });
}

/**
 * A value with a version, changed by who names the version it is of (`match`; without one by anybody). `again`: the same value once more
 * is a change too. `gaps`: a version is not always the next number, so that after a change of unknown outcome only what it is above is
 * known. A refusal is 'changed' (another one came first) or 'same' (it has that value already). The state: [version, value, above].
 */
export const versioned = (version, value, { again = true, gaps = false } = {}) => ({
  initial: [version, value, false],
  step(state, { op, match, value: wanted }, output) {
    const [now, kept, above] = state,
      is = (number) => (above ? number > now : number === now);
    if (op === 'read') return is(output.version) && output.value === kept ? [output.version, kept, false] : undefined;
    const fits = match === undefined || is(match),
      same = !again && wanted === kept,
      before = match ?? now;
    if (output?.refused === 'same') return same ? state : undefined;
    if (output?.refused) return match === undefined || above || !fits ? state : undefined;
    if (output === undefined) return fits && !same ? [before + (gaps ? 0 : 1), wanted, gaps] : state;
    const next = gaps ? output.version > before : output.version === before + 1;
    return fits && !same && next ? [output.version, wanted, false] : undefined;
  },
});

/** What failed, for people. */
export const shown = ({ key, longest, open }) =>
  [
    `${key}: no order explains it; ${longest.length} calls fit, the last of them`,
    ...longest.slice(-4).map(line),
    'and then none of',
    ...open.slice(0, 6).map(line),
  ].join('\n  ');
function line({ call, end, who = '', input, output }) {
  const known = output !== undefined,
    when = `${call.toFixed(0)}-${known ? end.toFixed(0) : '?'} ms`;
  return `${when} ${who} ${JSON.stringify(input)} -> ${known ? JSON.stringify(output) : 'unknown'}`;
}
