import { Whole } from './deltas';
import { elements, num, obj, str, type Unchecked } from './messages';
import type { LinkState, LiveSink, LiveSource } from './source';
import type { Received, Sent, TopicName, TopicParams } from './stream';

/// The part of WebSocket that is used, so that tests can play the server.
export interface Socket {
  onopen: (() => void) | null;
  onmessage: ((event: { data: unknown }) => void) | null;
  onclose: ((event: { code: number }) => void) | null;
  send(text: string): void;
  close(): void;
}
export interface Environment {
  open(): Socket;
  now_ms(): number; ///< steady
  wall_us(): number; ///< this machine's clock
  random(): number; ///< 0..1
  after(ms: number, call: () => void): () => void; ///< returns its cancel
}

/// A message of the server before anybody has looked at more of it than its op.
type Frame<Op extends Received['op']> = Op extends unknown
  ? Exclude<Unchecked<Extract<Received, { op: Op }>>, null | undefined> & { readonly op: Op }
  : never;

interface Topic {
  sub: number | null;
  seq: number | null;
  waiting: boolean;
  resubscribed_ms: number;
  readonly whole: Whole | null; ///< of a topic that comes as what changed
}

const LATE_MS = 2000,
  LOST_MS = 5000,
  CHECK_MS = 250; // dashboard.md section 4: LATE > 2 s, LOST > 5 s
const FIRST_RETRY_MS = 500,
  LAST_RETRY_MS = 10_000;
const TIME_EVERY_MS = 10_000;
const DRIFT_US_PER_MS = 0.1; // two clocks of 50 ppm each
const SEEN_EVERY_MS = 50;
const GREETING_MS = 10_000; // a connection attempt into a dead network would hang for minutes

/// Client of subprotocol anchord.v1: subscribes, follows seq and prev, resumes by epoch and seq, reconnects for ever. No DOM.
export class LiveClient implements LiveSource {
  readonly counters = { duplicates: 0, holes: 0, unreadable: 0, unknown_ops: 0 };
  private sink: LiveSink | null = null;
  private socket: Socket | null = null;
  private epoch: string | null = null;
  private offered: ReadonlySet<unknown> | null = null;
  private readonly topics = new Map<TopicName, Topic>();
  private readonly by_sub = new Map<number, TopicName>();
  private readonly by_id = new Map<number, TopicName>();
  private next_id = 1;
  private opened_ms = 0;
  private heard_ms = -Infinity;
  private state: LinkState = 'connecting';
  private greeted = false;
  private attempt = 0;
  private retry_at_ms: number | null = null;
  private cancel_retry: (() => void) | null = null;
  private cancel_check: (() => void) | null = null;
  /// Server's clock minus ours lies between: nothing arrives before it was sent, nothing is answered before it was asked.
  private least: { us: number; at_ms: number } | null = null;
  private most: { us: number; at_ms: number } | null = null;
  private beat_us: number | null = null;
  private conflating = false;
  private asked_time_ms = -Infinity;
  private minimum_retry_ms = 0;
  private frames = 0; ///< read of this connection
  private seen_ms = -Infinity; ///< when that was reported last
  private cancel_seen: (() => void) | null = null;
  private loss_open = false; ///< LOST was said, and not yet that it is over
  private resume: { recovered: Map<TopicName, number>; resynchronised: boolean; open: Set<TopicName> } | null = null;

  constructor(
    topics: readonly TopicName[],
    private readonly env: Environment,
    private readonly params: Readonly<Partial<Record<TopicName, TopicParams>>> = {},
  ) {
    for (const t of topics) {
      const whole = params[t]?.deltas ? new Whole() : null;
      this.topics.set(t, { sub: null, seq: null, waiting: false, resubscribed_ms: -Infinity, whole });
    }
  }

  start(sink: LiveSink): void {
    this.sink = sink;
    this.check();
    this.connect();
  }
  stop(): void {
    this.cancel_check?.();
    this.cancel_retry?.();
    this.drop_socket();
    this.sink = null;
  }
  retryNow(): void {
    if (!this.sink) return;
    this.cancel_retry?.();
    this.drop_socket();
    this.connect();
  }
  /// No attempts until retryNow(): the server will not talk to us, and asking again only fills its log.
  pause(): void {
    this.cancel_retry?.();
    this.retry_at_ms = null;
    this.drop_socket();
  }
  now_us(): number {
    return this.env.wall_us() + this.offset_us();
  }
  silence_ms(): number {
    return Math.max(0, this.env.now_ms() - this.heard_ms);
  }
  retry_in_ms(): number | null {
    return this.retry_at_ms === null ? null : Math.max(0, this.retry_at_ms - this.env.now_ms());
  }
  /// Age of the newest heartbeat by the server's clock: on a link that cannot keep up messages arrive all the time, and are old.
  data_age_ms(): number {
    const silence = this.silence_ms();
    return this.beat_us === null ? silence : Math.max(silence, (this.now_us() - this.beat_us) / 1000);
  }
  slow(): boolean {
    return this.conflating;
  }
  /// Clock of the server minus ours: the middle of what is possible. A delay now does not move it, so that late data is seen to be late.
  offset_us(): number {
    const now = this.env.now_ms(),
      least = this.least && this.least.us - DRIFT_US_PER_MS * (now - this.least.at_ms),
      most = this.most && this.most.us + DRIFT_US_PER_MS * (now - this.most.at_ms);
    return least === null ? 0 : most === null ? least : (least + most) / 2;
  }

  private connect(): void {
    this.retry_at_ms = null;
    this.greeted = false;
    this.opened_ms = this.env.now_ms();
    this.frames = 0;
    this.seen_ms = -Infinity;
    const socket = this.env.open();
    this.socket = socket;
    socket.onmessage = (event) => {
      if (this.socket !== socket) return;
      this.receive(event.data);
      this.frames++;
      this.report_seen();
    };
    socket.onclose = (event) => {
      if (this.socket === socket) this.closed(event.code);
    };
  }
  private drop_socket(): void {
    const socket = this.socket;
    this.socket = null;
    this.forget_report();
    if (!socket) return;
    socket.onmessage = socket.onclose = socket.onopen = null;
    try {
      socket.close();
    } catch {
      /* already closing */
    }
  }
  private closed(code: number): void {
    this.socket = null;
    this.forget_report();
    if (!this.greeted || code === 4001 || code === 4003) this.sink?.refused();
    this.retry_later();
  }
  private retry_later(): void {
    const ceiling = Math.min(LAST_RETRY_MS, FIRST_RETRY_MS * 2 ** this.attempt++);
    const wait = Math.max(this.minimum_retry_ms, FIRST_RETRY_MS + this.env.random() * (ceiling - FIRST_RETRY_MS));
    this.minimum_retry_ms = 0;
    this.retry_at_ms = this.env.now_ms() + wait;
    this.cancel_retry?.();
    this.cancel_retry = this.env.after(wait, () => this.connect());
  }

  private check(): void {
    this.cancel_check = this.env.after(CHECK_MS, () => this.check());
    const silence = this.env.now_ms() - this.heard_ms;
    if (this.socket && !this.greeted && this.env.now_ms() - this.opened_ms > GREETING_MS) {
      this.drop_socket();
      this.retry_later();
    }
    if (silence === Infinity) return;
    const age = this.data_age_ms();
    this.set_link(age > LOST_MS ? 'lost' : age > LATE_MS ? 'late' : 'live');
    if (silence > LOST_MS && this.socket && this.greeted) {
      // an open socket that says nothing is a dead one
      this.drop_socket();
      this.retry_later();
    }
    if (this.socket && this.greeted && this.env.now_ms() - this.asked_time_ms > TIME_EVERY_MS) this.ask_time();
  }
  private set_link(state: LinkState): void {
    if (state === this.state) return;
    this.state = state;
    if (state === 'lost') this.loss_open = true;
    this.sink?.link(state);
    // Data that only came late needs no new connection; whoever was told LOST is told that it is over all the same.
    if (state === 'live' && this.loss_open && !this.resume) this.back(new Map(), false);
  }
  private back(recovered: ReadonlyMap<TopicName, number>, resynchronised: boolean): void {
    this.loss_open = false;
    this.sink?.resumed(recovered, resynchronised);
  }
  private ask_time(): void {
    this.asked_time_ms = this.env.now_ms();
    this.send({ op: 'time', id: this.next_id++, c_us: this.env.wall_us() });
  }
  /// The socket takes in whatever comes; only the server can leave out what this page is too slow for, so it is told where the page is.
  private report_seen(): void {
    const wait_ms = SEEN_EVERY_MS - (this.env.now_ms() - this.seen_ms);
    if (wait_ms > 0) {
      this.cancel_seen ??= this.env.after(wait_ms, () => {
        this.cancel_seen = null;
        this.report_seen();
      });
      return;
    }
    this.forget_report();
    this.seen_ms = this.env.now_ms();
    this.send({ op: 'seen', frames: this.frames });
  }
  private forget_report(): void {
    this.cancel_seen?.();
    this.cancel_seen = null;
  }
  private send(message: Sent): void {
    this.socket?.send(JSON.stringify(message));
  }

  private receive(text: unknown): void {
    let message: Frame<Received['op']> | null = null;
    try {
      message = typeof text === 'string' ? (obj(JSON.parse(text)) as Frame<Received['op']> | null) : null;
    } catch {
      /* counted below */
    }
    if (!message) {
      this.counters.unreadable++;
      return;
    }
    this.heard_ms = this.env.now_ms();
    switch (message.op) {
      case 'hello':
        return this.hello(message);
      case 'ack':
        return this.ack(message);
      case 'snap':
      case 'data':
        return this.content(message);
      case 'gap':
        return this.gap(message);
      case 'hb':
        return this.heartbeat(message);
      case 'time':
        return this.time(message);
      case 'err':
        return this.error(message);
      case 'bye':
        this.minimum_retry_ms = Math.min(LAST_RETRY_MS, num(message.retry_ms) ?? 0);
        return;
      default:
        this.counters.unknown_ops++;
    }
  }

  private hello(m: Frame<'hello'>): void {
    this.greeted = true;
    this.attempt = 0;
    const again = this.epoch !== null;
    const restarted = again && this.epoch !== str(m.epoch);
    this.epoch = str(m.epoch);
    this.sink?.server(str(m.server));
    const t_us = num(m.t_us);
    if (t_us !== null) this.clock_bounds(t_us - this.env.wall_us(), null); // the snapshots that follow have ages
    if (restarted) {
      for (const t of this.topics.values()) t.seq = null;
      this.sink?.restarted();
    }
    const offered = (this.offered = Array.isArray(m.topics) ? new Set(elements(m.topics)) : null);
    this.by_sub.clear();
    this.by_id.clear();
    const wanted = [...this.topics.keys()].filter((t) => !offered || offered.has(t));
    this.resume = again ? { recovered: new Map(), resynchronised: restarted, open: new Set(wanted) } : null;
    this.beat_us = null;
    this.conflating = false;
    for (const name of wanted) this.subscribe(name);
    this.set_link('live');
    this.ask_time();
  }
  offers(topic: TopicName): boolean {
    return this.offered?.has(topic) ?? false;
  }
  private subscribe(name: TopicName): void {
    const topic = this.topics.get(name);
    if (!topic) return;
    const id = this.next_id++;
    this.by_id.set(id, name);
    topic.sub = null;
    topic.waiting = true;
    const since = topic.seq !== null && this.epoch ? { since: { epoch: this.epoch, seq: topic.seq } } : {};
    this.send({ op: 'sub', id, topic: name, params: this.params[name] ?? {}, ...since });
  }
  private ack(m: Frame<'ack'>): void {
    const [id, sub] = [num(m.id), num(m.sub)];
    const name = id === null ? undefined : this.by_id.get(id);
    const topic = name === undefined ? undefined : this.topics.get(name);
    if (!topic || !name || sub === null || id === null) return;
    this.by_id.delete(id);
    this.by_sub.set(sub, name);
    topic.sub = sub;
    topic.waiting = false;
    if (m.recovered !== true) {
      if (topic.seq !== null && this.resume) this.resume.resynchronised = true;
      topic.seq = null; // the snapshot, or the first message, says where we stand
    }
    this.resume?.open.delete(name);
    // What is replayed follows its ack; the heartbeat after the last ack ends the count.
  }
  private content(m: Frame<'snap' | 'data'>): void {
    const sub = num(m.sub);
    const name = sub === null ? undefined : this.by_sub.get(sub);
    const topic = name === undefined ? undefined : this.topics.get(name);
    const seq = num(m.seq);
    if (!topic || !name || topic.sub !== sub || seq === null) return;
    const t_us = num(m.t_us) ?? this.now_us();
    if (m.op === 'snap') {
      topic.seq = seq;
      topic.whole?.snap(m.data);
      this.sink?.snap(name, m.data, t_us);
      return;
    }
    if (topic.seq !== null && seq <= topic.seq) {
      this.counters.duplicates++;
      return;
    }
    const prev = num(m.prev);
    if (topic.seq !== null && prev !== null && prev > topic.seq) {
      this.hole(name, topic);
      return;
    }
    const data = topic.whole ? topic.whole.data(m.data) : m.data;
    if (data === null) {
      topic.seq = null; // whole again: not from where we stand
      this.hole(name, topic);
      return;
    }
    topic.seq = seq;
    this.resume?.recovered.set(name, (this.resume.recovered.get(name) ?? 0) + 1);
    this.sink?.data(name, data, t_us);
  }
  /// A jump that nobody announced: ask again from where we stand. Once in two seconds, else a broken server would be asked for ever.
  private hole(name: TopicName, topic: Topic): void {
    this.counters.holes++;
    if (this.env.now_ms() - topic.resubscribed_ms < 2000) {
      topic.seq = null;
      return;
    }
    topic.resubscribed_ms = this.env.now_ms();
    if (topic.sub !== null) {
      this.by_sub.delete(topic.sub);
      this.send({ op: 'unsub', id: this.next_id++, sub: topic.sub });
    }
    this.subscribe(name);
  }
  private gap(m: Frame<'gap'>): void {
    const sub = num(m.sub);
    const name = sub === null ? undefined : this.by_sub.get(sub);
    const topic = name === undefined ? undefined : this.topics.get(name);
    if (!topic || !name) return;
    topic.seq = Math.max(topic.seq ?? 0, num(m.to_seq) ?? 0);
    this.sink?.gap(name, num(m.dropped) ?? 0);
  }
  private heartbeat(m: Frame<'hb'>): void {
    const t_us = num(m.t_us);
    if (t_us !== null) {
      this.clock_bounds(t_us - this.env.wall_us(), null);
      this.beat_us = t_us;
    }
    this.conflating = m.conflating === true;
    if (this.resume && this.resume.open.size === 0) {
      const { recovered, resynchronised } = this.resume;
      this.resume = null;
      this.back(recovered, resynchronised);
    }
  }
  private time(m: Frame<'time'>): void {
    const [c_us, t_us] = [num(m.c_us), num(m.t_us)];
    if (c_us === null || t_us === null) return;
    const now = this.env.wall_us();
    this.clock_bounds(t_us - now, t_us - c_us);
  }
  /// The tightest bounds stay, widened by what two clocks may drift. Bounds that exclude each other mean that a clock was set: begin anew.
  private clock_bounds(least_us: number, most_us: number | null): void {
    const at_ms = this.env.now_ms(),
      least = this.least && this.least.us - DRIFT_US_PER_MS * (at_ms - this.least.at_ms),
      most = this.most && this.most.us + DRIFT_US_PER_MS * (at_ms - this.most.at_ms);
    const stepped = (most !== null && least_us > most) || (most_us !== null && least !== null && most_us < least);
    if (least === null || least_us > least || stepped) this.least = { us: least_us, at_ms };
    if (stepped) this.most = null;
    if (most_us !== null && (most === null || most_us < most || stepped)) this.most = { us: most_us, at_ms };
  }
  private error(m: Frame<'err'>): void {
    const id = num(m.id);
    const name = id === null ? undefined : this.by_id.get(id);
    if (id === null || name === undefined) return;
    this.by_id.delete(id);
    this.resume?.open.delete(name); // refused for this role: the others go on
    const topic = this.topics.get(name);
    if (topic) topic.waiting = false;
  }
}
