/// How old a value is: by when it was measured, not by when this page came to know of it. A page that is loaded now is given values of a device that is
/// silent for minutes, and they must look it. No DOM, no signals; time comes in as an argument.

/// Whose clock wrote the time of a row. Positions and ranges may come from two; what the server itself says carries the server's time.
export type TimeOf = 'position' | 'range' | 'server';
export interface Arrival {
  readonly t_us: number; ///< of the row
  readonly now_ms: number; ///< steady, of this page
  readonly server_now_us: number;
  readonly data_age_ms: number; ///< how late the link itself is
  readonly live: boolean; ///< sent as it was made; a snapshot, or what an outage held back, is not
}

const LATENCY_MS = 2000, // so late is a row on its way through receiver, server and link
  STEADY_MS = 2000,
  TIMELY_MS = 1000, // a link that is later than this says nothing of a clock
  WOBBLE_MS = 500; // by so much the lag of a clock that is off may differ within STEADY_MS
/// By how much a clock of a flight differs from the server's (positive: it is behind), by the rows that come live: the least lag. A row that is late by
/// more than its way takes may be what a gateway held back, whose lag shrinks as it catches up: only a lag that stays is a clock that is behind.
class Skew {
  ms: number | null = null; ///< null: nothing came live yet
  private late: { since_ms: number; lag_ms: number } | null = null;
  private last_t_us = -Infinity;

  learn(a: Arrival, lag_ms: number): void {
    if (!a.live || a.data_age_ms > TIMELY_MS || a.t_us <= this.last_t_us) return;
    this.last_t_us = a.t_us;
    if (this.ms === null ? lag_ms < LATENCY_MS : lag_ms < this.ms) this.ms = lag_ms;
    if (this.ms !== null && lag_ms - this.ms < WOBBLE_MS) {
      this.late = null;
    } else if (!this.late || Math.abs(lag_ms - this.late.lag_ms) > WOBBLE_MS) {
      this.late = { since_ms: a.now_ms, lag_ms };
    } else if (a.now_ms - this.late.since_ms >= STEADY_MS) {
      this.ms = this.late.lag_ms;
      this.late = null;
    }
  }
}

export class Measured {
  private readonly skews = new Map<string, Skew>();

  /// When a row was measured, by the steady clock of this page: never later than it came. Of a row of the future nothing is known until its clock is.
  at_ms(mission: string, of: TimeOf, a: Arrival, teaches = true): number {
    if (a.t_us <= 0) return a.now_ms; // says no time
    const lag_ms = (a.server_now_us - a.t_us) / 1000;
    if (of === 'server') return a.now_ms - Math.max(0, lag_ms);
    const key = `${of} ${mission}`;
    let skew = this.skews.get(key);
    if (!skew) this.skews.set(key, (skew = new Skew()));
    if (teaches) skew.learn(a, lag_ms);
    // Nothing was timely yet: a recording that is replayed faster than it was flown, or a clock that is off. What comes as it is made counts from then.
    if (skew.ms === null && a.live && a.data_age_ms <= TIMELY_MS) return a.now_ms;
    if (skew.ms === null && lag_ms < -LATENCY_MS) return -Infinity;
    return a.now_ms - Math.max(0, lag_ms - (skew.ms ?? 0));
  }
  clear(): void {
    this.skews.clear();
  }
}
