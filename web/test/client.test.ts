import { beforeEach, describe, expect, it } from 'vitest';
import { LiveClient, type Socket } from '../src/live/client';
import type { LinkState } from '../src/live/source';

/// Time, chance and the server, all in the hand of the test.
class World {
  now = 0;
  wall_offset_us = 1_000_000_000_000_000;
  sockets: FakeSocket[] = [];
  private timers: { at: number; call: () => void; on: boolean }[] = [];
  environment = {
    open: (): Socket => {
      const s = new FakeSocket();
      this.sockets.push(s);
      return s;
    },
    now_ms: () => this.now,
    wall_us: () => this.wall_offset_us + this.now * 1000,
    random: () => 1,
    after: (ms: number, call: () => void) => {
      const t = { at: this.now + ms, call, on: true };
      this.timers.push(t);
      return () => {
        t.on = false;
      };
    },
  };
  get socket(): FakeSocket {
    return this.sockets[this.sockets.length - 1]!;
  }
  advance(ms: number): void {
    const end = this.now + ms;
    for (;;) {
      const next = this.timers.filter((t) => t.on && t.at <= end).sort((a, b) => a.at - b.at)[0];
      if (!next) break;
      next.on = false;
      this.now = Math.max(this.now, next.at);
      next.call();
    }
    this.now = end;
  }
}
class FakeSocket implements Socket {
  onopen: (() => void) | null = null;
  onmessage: ((e: { data: unknown }) => void) | null = null;
  onclose: ((e: { code: number }) => void) | null = null;
  sent: Record<string, unknown>[] = [];
  send(text: string): void {
    this.sent.push(JSON.parse(text) as Record<string, unknown>);
  }
  close(): void {
    /* the client forgets us */
  }
  say(m: object): void {
    this.onmessage?.({ data: JSON.stringify(m) });
  }
  sub(topic: string): Record<string, unknown> {
    return this.sent.filter((x) => x.op === 'sub' && x.topic === topic).at(-1)!;
  }
}

let world: World, client: LiveClient, log: string[], links: LinkState[];
const hello = (epoch = 'e1'): void =>
  world.socket.say({ op: 'hello', epoch, t_us: 0, hb_ms: 1000, topics: ['events'], roles: [] });
const ack = (recovered: boolean, sub = 11): void =>
  world.socket.say({ op: 'ack', id: world.socket.sub('events').id, sub, from_seq: 1, recovered });
const data = (seq: number, prev: number | null, sub = 11): void =>
  world.socket.say({ op: 'data', sub, seq, prev, t_us: 5, data: { n: seq } });
/// A heartbeat that was so long on its way.
const beat = (late_ms = 0): void => world.socket.say({ op: 'hb', t_us: world.environment.wall_us() - late_ms * 1000 });

beforeEach(() => {
  world = new World();
  log = [];
  links = [];
  client = new LiveClient(['events'], world.environment);
  client.start({
    snap: (t, d) => log.push(`snap ${t} ${JSON.stringify(d)}`),
    data: (_t, d) => log.push(`data ${(d as { n: number }).n}`),
    gap: (_t, n) => log.push(`gap ${n}`),
    restarted: () => log.push('restarted'),
    server: () => 0,
    resumed: (n, again) => log.push(`resumed ${[...n].map(([t, k]) => `${t} ${k}`).join()} ${again}`),
    link: (s) => links.push(s),
    refused: () => log.push('refused'),
  });
});
function up_to(seq: number): void {
  hello();
  ack(false);
  world.socket.say({ op: 'snap', sub: 11, seq: seq - 1, t_us: 1, data: [] });
  data(seq, seq - 1);
}

describe('LiveClient', () => {
  it('subscribes after hello, without since at first, and hands on snapshot and data', () => {
    up_to(5);
    expect(world.socket.sub('events').since).toBeUndefined();
    expect(log).toEqual(['snap events []', 'data 5']);
  });
  it('subscribes only to what the server offers', () => {
    const c = new LiveClient(['events', 'mission.turn'], world.environment);
    c.start({ snap() {}, data() {}, gap() {}, restarted() {}, server() {}, resumed() {}, link() {}, refused() {} });
    hello();
    expect(world.socket.sent.filter((x) => x.op === 'sub').map((x) => x.topic)).toEqual(['events']);
  });
  it('drops a duplicate and counts it', () => {
    up_to(5);
    data(5, 4);
    data(4, 3);
    expect(log.filter((l) => l === 'data 5')).toHaveLength(1);
    expect(client.counters.duplicates).toBe(2);
  });
  it('accepts a jump that prev explains (filtered or conflated)', () => {
    up_to(5);
    data(9, 5);
    expect(log.at(-1)).toBe('data 9');
    expect(client.counters.holes).toBe(0);
  });
  it('subscribes again from where it stands when a jump was not announced', () => {
    up_to(5);
    data(9, 8);
    expect(client.counters.holes).toBe(1);
    expect(log).not.toContain('data 9');
    expect(world.socket.sent.some((x) => x.op === 'unsub' && x.sub === 11)).toBe(true);
    expect(world.socket.sub('events').since).toEqual({ epoch: 'e1', seq: 5 });
    ack(true, 12);
    data(6, 5, 12);
    data(7, 6, 12);
    expect(log.slice(-2)).toEqual(['data 6', 'data 7']);
  });
  it('does not ask for ever when the server keeps leaving holes', () => {
    up_to(5);
    data(9, 8);
    const asked = world.socket.sent.filter((x) => x.op === 'sub').length;
    ack(true, 12);
    data(20, 19, 12);
    data(21, 20, 12);
    expect(world.socket.sent.filter((x) => x.op === 'sub').length).toBe(asked);
    expect(log.at(-1)).toBe('data 21');
  });
  it('goes on after a gap the server told', () => {
    up_to(5);
    world.socket.say({ op: 'gap', sub: 11, from_seq: 6, to_seq: 70, reason: 'slow_consumer', dropped: 65 });
    data(71, 70);
    expect(log.slice(-2)).toEqual(['gap 65', 'data 71']);
    expect(client.counters.holes).toBe(0);
  });
  it('resumes by epoch and seq after a broken connection and says how much was recovered', () => {
    up_to(5);
    world.socket.onclose!({ code: 1006 });
    world.advance(600);
    expect(world.sockets).toHaveLength(2);
    hello();
    expect(world.socket.sub('events').since).toEqual({ epoch: 'e1', seq: 5 });
    ack(true, 3);
    data(5, 4, 3);
    data(6, 5, 3);
    data(7, 6, 3);
    beat();
    expect(log.slice(-3)).toEqual(['data 6', 'data 7', 'resumed events 2 false']);
  });
  it('takes the snapshot when the history is gone', () => {
    up_to(5);
    world.socket.onclose!({ code: 1006 });
    world.advance(600);
    hello();
    ack(false, 3);
    world.socket.say({ op: 'snap', sub: 3, seq: 900, t_us: 1, data: [1] });
    data(901, 900, 3);
    beat();
    expect(log.slice(-3)).toEqual(['snap events [1]', 'data 901', 'resumed events 1 true']);
  });
  it('forgets everything when the epoch changed', () => {
    up_to(5);
    world.socket.onclose!({ code: 1006 });
    world.advance(600);
    hello('e2');
    expect(log.at(-1)).toBe('restarted');
    expect(world.socket.sub('events').since).toBeUndefined();
    ack(false, 1);
    world.socket.say({ op: 'snap', sub: 1, seq: 1, t_us: 1, data: [] });
    data(2, 1, 1);
    expect(log.at(-1)).toBe('data 2'); // lower than before, and right
  });
  it('is late after two seconds of silence and lost after five, then live again', () => {
    up_to(5);
    world.advance(1900);
    expect(links).toEqual(['live']);
    world.advance(400);
    expect(links.at(-1)).toBe('late');
    world.advance(3000);
    expect(links.at(-1)).toBe('lost');
    world.advance(10_000);
    hello();
    expect(links.at(-1)).toBe('live');
  });
  it('drops an open socket that says nothing, and connects anew', () => {
    up_to(5);
    world.advance(5300);
    expect(client.retry_in_ms()).not.toBeNull();
    world.advance(1000);
    expect(world.sockets).toHaveLength(2);
  });
  it('gives up an attempt that nobody answers, and tries again', () => {
    world.advance(10_300);
    expect(client.retry_in_ms()).not.toBeNull();
    world.advance(600);
    expect(world.sockets).toHaveLength(2);
  });
  it('rests when told so, until somebody asks it to go on', () => {
    hello();
    client.pause();
    world.advance(60_000);
    expect(world.sockets).toHaveLength(1);
    client.retryNow();
    expect(world.sockets).toHaveLength(2);
  });
  it('backs off from half a second to ten and never stops', () => {
    hello();
    const waits: number[] = [];
    for (let i = 0; i < 8; i++) {
      world.socket.onclose!({ code: 1006 });
      const wait = client.retry_in_ms()!;
      waits.push(wait);
      world.advance(wait + 1);
    }
    expect(waits).toEqual([500, 1000, 2000, 4000, 8000, 10_000, 10_000, 10_000]);
  });
  it('waits as long as a leaving server asks', () => {
    hello();
    world.socket.say({ op: 'bye', code: 4010, reason: 'shutting_down', retry_ms: 2000 });
    world.socket.onclose!({ code: 4010 });
    expect(client.retry_in_ms()).toBe(2000);
  });
  it('asks who we are when the server hangs up before hello or for lack of a session', () => {
    world.socket.onclose!({ code: 1006 });
    expect(log).toEqual(['refused']);
    world.advance(600);
    hello();
    world.socket.onclose!({ code: 4001 });
    expect(log).toEqual(['refused', 'refused']);
  });
  it('knows the server clock from a round trip, to half its length', () => {
    hello();
    const asked = world.socket.sent.find((x) => x.op === 'time')!;
    world.advance(40);
    // server clock is 3 s ahead; the answer was written 20 ms after the question left
    world.socket.say({ op: 'time', id: asked.id, c_us: asked.c_us, t_us: (asked.c_us as number) + 20_000 + 3_000_000 });
    expect(client.offset_us()).toBe(3_000_000);
    world.socket.say({ op: 'hb', t_us: world.environment.wall_us() + 2_500_000 }); // delayed: worse than the round trip
    expect(client.offset_us()).toBe(3_000_000);
    expect(client.now_us() - world.environment.wall_us()).toBe(3_000_000);
  });
  it('is late, then lost, when what arrives is old, although messages arrive all the time', () => {
    up_to(5);
    beat();
    for (let late_ms = 0; late_ms <= 6000; late_ms += 1000) {
      world.advance(1000);
      beat(late_ms);
    }
    world.advance(250);
    expect(links).toEqual(['live', 'late', 'lost']);
    expect(client.silence_ms()).toBe(250);
    expect(client.data_age_ms()).toBeCloseTo(6250, -1);
    expect(world.sockets).toHaveLength(1); // the link works: hanging up would lose what is on its way
    for (let i = 0; i < 3; i++) {
      world.advance(1000);
      beat(50);
    }
    world.advance(250);
    expect(links.at(-1)).toBe('live');
    expect(log.filter((l) => l.startsWith('resumed'))).toEqual(['resumed  false']); // LOST was said: so is its end
  });
  it('says once that a loss is over where it took a new connection', () => {
    up_to(5);
    beat();
    world.advance(6000);
    expect(links.at(-1)).toBe('lost');
    world.advance(2000);
    hello();
    ack(true, 3);
    data(6, 5, 3);
    beat();
    world.advance(500);
    beat();
    world.advance(500);
    expect(links.at(-1)).toBe('live');
    expect(log.filter((l) => l.startsWith('resumed'))).toEqual(['resumed events 1 false']);
  });
  it('does not take a growing delay for a clock that goes wrong, but a clock that was set for one', () => {
    hello();
    const asked = world.socket.sent.find((x) => x.op === 'time')!;
    world.advance(20);
    world.socket.say({ op: 'time', id: asked.id, c_us: asked.c_us, t_us: (asked.c_us as number) + 10_000 });
    for (let i = 0; i < 60; i++) {
      world.advance(1000);
      beat(8000);
    }
    const now_us = world.environment.wall_us();
    world.socket.say({ op: 'time', id: 99, c_us: now_us - 8e6, t_us: now_us - 7.9e6 });
    expect(Math.abs(client.offset_us())).toBeLessThan(20_000);
    world.wall_offset_us -= 3_600_000_000; // this machine's clock is set back by an hour
    beat();
    world.socket.say({ op: 'hb', t_us: world.environment.wall_us() + 3_600_000_000 });
    expect(client.offset_us()).toBeCloseTo(3_600_000_000, -5);
  });
  it('tells when the server leaves messages out for it', () => {
    up_to(5);
    world.socket.say({ op: 'hb', t_us: world.environment.wall_us(), queue: 0.9, conflating: true });
    expect(client.slow()).toBe(true);
    beat();
    expect(client.slow()).toBe(false);
  });
  it('reports what it has read, at most twenty times a second, and all of it in the end', () => {
    const seen = (): unknown[] => world.socket.sent.filter((x) => x.op === 'seen').map((x) => x.frames);
    up_to(5); // hello, ack, snap, data
    expect(seen()).toEqual([1]);
    world.advance(49);
    expect(seen()).toEqual([1]);
    world.advance(1);
    expect(seen()).toEqual([1, 4]);
    world.advance(1000);
    expect(seen()).toEqual([1, 4]);
    for (let i = 0; i < 100; i++) {
      data(6 + i, 5 + i);
      world.advance(10);
    }
    world.advance(50);
    expect(seen().length).toBeGreaterThan(15);
    expect(seen().length).toBeLessThanOrEqual(23);
    expect(seen().at(-1)).toBe(104);
    world.socket.onmessage!({ data: '{"op":' });
    world.socket.onclose!({ code: 1006 });
    world.advance(600);
    hello();
    expect(seen()).toEqual([1]); // another connection counts anew, and owes nothing of the last one
  });
  it('ignores what it cannot read and ops it does not know', () => {
    up_to(5);
    world.socket.onmessage!({ data: '{"op":' });
    world.socket.onmessage!({ data: new ArrayBuffer(3) });
    world.socket.say({ op: 'dance' });
    world.socket.say({ op: 'data', sub: 99, seq: 1, data: {} });
    expect(client.counters).toMatchObject({ unreadable: 2, unknown_ops: 1 });
    expect(log.at(-1)).toBe('data 5');
  });
});
