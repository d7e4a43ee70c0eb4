/// Which alarms stand, and when one may sound. No DOM, time comes in as an argument.
import type { AlarmMsg, EventMsg, FixClass } from '../live/messages';
import type { LinkState } from '../live/source';

export type Priority = AlarmMsg['priority'];
export interface Alarm {
  readonly id: string;
  readonly priority: Priority;
  readonly title: string;
  readonly advice: string;
  readonly since_ms: number;
  readonly acknowledged: boolean;
}

export interface Situation {
  readonly now_ms: number;
  readonly link: LinkState;
  readonly silence_ms: number;
  readonly data_age_ms: number; ///< by the server's clock; more than the silence where the link cannot keep up
  readonly slow: boolean; ///< the server leaves out what the link cannot carry
  readonly recording: boolean; ///< a mission runs
  readonly fix: FixClass | null;
  readonly correction_age_s: number | null;
  readonly range_silence_ms: number; ///< Infinity before the first range
  readonly refused: Refusal | null; ///< the newest command that the aircraft or the procedure did not carry out
}
export interface Refusal {
  readonly id: string;
  readonly text: string;
  readonly age_ms: number;
}
export function newest_refusal(
  events: readonly EventMsg[],
  mission: string | null,
  server_now_us: number,
): Refusal | null {
  const e = events.filter((x) => x.code === 'cmd.refused' && x.mission === mission).at(-1);
  return e ? { id: e.id, text: e.text, age_ms: Math.max(0, server_now_us - e.t_us) / 1000 } : null;
}
const REFUSED_MS = 60_000; ///< for so long a refusal is news

const RANK: Record<Priority, number> = { critical: 0, warning: 1, advisory: 2 };
export const by_rank = (a: Alarm, b: Alarm): number => RANK[a.priority] - RANK[b.priority] || a.since_ms - b.since_ms;

const quiet = (a: Alarm): number => (a.priority === 'advisory' ? 2 : a.acknowledged ? 1 : 0);
/// Which alarm the line shows: while the link is lost, that one, since all others are only "when last seen"; else what nobody has
/// acknowledged, then what somebody has, advice last.
export const by_urgency = (a: Alarm, b: Alarm): number =>
  Number(b.id === 'link.lost') - Number(a.id === 'link.lost') || quiet(a) - quiet(b) || by_rank(a, b);

/// Conditions of dashboard.md section 6 that the page can see by itself, with the delays named there. Keeps since when each holds.
export class Conditions {
  private readonly since = new Map<string, number>();
  private received: readonly Alarm[] = [];
  private data_from_ms = -Infinity; ///< since when data could arrive again: silence before that says nothing of the tag

  standing(s: Situation): Alarm[] {
    const out: Alarm[] = [];
    const hold = (
      id: string,
      on: boolean,
      delay_ms: number,
      priority: Priority,
      title: string,
      advice: string,
    ): void => {
      if (!on) {
        this.since.delete(id);
        return;
      }
      const began = this.since.get(id) ?? s.now_ms;
      this.since.set(id, began);
      if (s.now_ms - began >= delay_ms)
        out.push({ id, priority, title, advice, since_ms: began + delay_ms, acknowledged: false });
    };
    // No data, no judgement: what was standing stands, what was about to be raised starts anew when data is back.
    if (s.link !== 'live') {
      this.data_from_ms = s.now_ms;
      const standing = new Set(this.received.map((a) => a.id));
      for (const id of this.since.keys()) if (!standing.has(id)) this.since.delete(id);
    }
    if (s.link === 'late') return [...this.received];
    if (s.link === 'lost') {
      // Nothing new can be said about the others, so they neither appear nor vanish: they read "when last seen".
      if (s.recording)
        out.push({
          id: 'link.lost',
          priority: 'critical',
          title: s.silence_ms < 2000 ? 'Link too slow: data arrives late' : 'Link lost: no data from anchord',
          advice: 'To act now, use the remote control. The drone continues its procedure on its own.',
          since_ms: s.now_ms - s.data_age_ms,
          acknowledged: false,
        });
      return [...out, ...this.received.map(when_last_seen)];
    }
    hold(
      'ws.slow',
      s.slow,
      2000,
      'advisory',
      'This page cannot keep up',
      'It receives updates less often, but none that are older. Go nearer to the access point, or close other pages and programs.',
    );
    if (s.refused && s.refused.age_ms < REFUSED_MS)
      out.push({
        id: 'cmd.refused',
        priority: 'warning',
        title: `Command refused: ${s.refused.text.replace(/^\w+ refused: /, (w) => w.replace(' refused', ''))}`,
        advice: 'It was not carried out. Remove the reason and command again, or use the remote control.',
        since_ms: s.now_ms - s.refused.age_ms,
        acknowledged: false,
      });
    const range_silence_ms = Math.min(s.range_silence_ms, s.now_ms - this.data_from_ms);
    const ranging = s.recording && s.range_silence_ms < 60_000;
    const poor = s.fix === 'none' || s.fix === 'single' || s.fix === 'dgps';
    hold(
      'rtk.lost',
      s.recording && (poor || (s.correction_age_s ?? 0) > 10),
      2000,
      'critical',
      `RTK lost: ${poor ? fix_word(s.fix) : `corrections ${Math.round(s.correction_age_s ?? 0)} s old`}`,
      'Ranges are recorded; those without a good position are not used. Check the base radio and the sky view.',
    );
    hold(
      'rtk.float',
      ranging && s.fix === 'float',
      5000,
      'warning',
      'RTK is FLOAT',
      'Ranges are marked and weighted less. Hover in open sky until FIX returns.',
    );
    hold(
      'uwb.none',
      ranging && range_silence_ms > 5000,
      0,
      'warning',
      'No UWB ranges for 5 s',
      'Check the tag and its cable, or fly closer to the anchors.',
    );
    return (this.received = out.sort(by_rank));
  }
}

const when_last_seen = (a: Alarm): Alarm => ({ ...a, title: `${a.title}, when last seen`, acknowledged: true });

/// Which flight is on the screen, and what the others are called.
export interface Screen {
  readonly mission: string | null;
  readonly name: (mission: string) => string;
}

/// Server's list and the page's own, once per id and flight; the server's word wins where both speak. An alarm of a flight that is not on the screen has
/// its name before it (most of the server's have), and never stands for the same one of the flight that is. With the link lost the words are those that
/// were heard last.
export function merged(
  own: readonly Alarm[],
  server: readonly AlarmMsg[],
  server_now_us: number,
  now_ms: number,
  lost: boolean,
  screen: Screen,
): Alarm[] {
  const named = new Map(own.map((a) => [a.id, a]));
  for (const a of server) {
    const elsewhere = a.mission && a.mission !== screen.mission,
      id = elsewhere ? `${a.id} of ${a.mission}` : a.id,
      name = a.mission && screen.name(a.mission),
      text = a.text || a.id;
    const known: Alarm = {
      id,
      priority: a.priority,
      title:
        name && text.startsWith(name)
          ? text
          : (elsewhere ? `Flight ${name}: ` : '') + text[0]!.toUpperCase() + text.slice(1),
      advice: named.get(id)?.advice ?? '',
      since_ms: now_ms - Math.max(0, server_now_us - a.since_us) / 1000,
      acknowledged: a.acknowledged,
    };
    named.set(id, lost ? when_last_seen(known) : known);
  }
  return [...named.values()].sort(by_rank);
}

export const fix_word = (fix: FixClass | null): string =>
  ({ none: 'NO FIX', single: 'SINGLE', dgps: 'DGPS', float: 'FLOAT', fixed: 'FIX' })[fix ?? 'none'];

/// Same alarm at most once in 30 s (critical 10 s); a warning sounds once per appearance; muted until a time, or until the next critical.
export class AlarmLimiter {
  private readonly last_ms = new Map<string, number>();
  private standing = new Set<string>();
  private muted_until_ms = -Infinity;
  private muted_until_critical = false;

  mute(until_ms: number): void {
    this.muted_until_ms = until_ms;
    this.muted_until_critical = false;
  }
  mute_until_critical(): void {
    this.muted_until_critical = true;
  }
  unmute(): void {
    this.muted_until_ms = -Infinity;
    this.muted_until_critical = false;
  }
  muted(now_ms: number): boolean {
    return this.muted_until_critical || now_ms < this.muted_until_ms;
  }

  /// The one alarm that may sound now, or null. Call at every change and at least once a second.
  due(alarms: readonly Alarm[], now_ms: number): Alarm | null {
    const before = this.standing;
    this.standing = new Set(alarms.map((a) => a.id));
    for (const a of [...alarms].sort(by_rank)) {
      if (a.acknowledged || a.priority === 'advisory') continue;
      const fresh = !before.has(a.id);
      if (a.priority === 'critical' && fresh) this.muted_until_critical = false;
      const gap = now_ms - (this.last_ms.get(a.id) ?? -Infinity);
      const wants = a.priority === 'critical' ? gap >= 10_000 : fresh && gap >= 30_000;
      if (!wants) continue;
      if (this.muted(now_ms)) continue;
      this.last_ms.set(a.id, now_ms);
      return a;
    }
    return null;
  }
}
