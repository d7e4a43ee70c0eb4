/// What a person meant with a press, judged by when the finger came and went and not by when a slow page took it up. No DOM; times in ms of one clock,
/// that of Event.timeStamp and performance.now().
export const HOLD_MS = 1000,
  CONFIRM_MS = 4000;
const LATE_MS = 150;

export class Press {
  private down_ms: number | null = null;
  private waited = false;
  private asked_ms = Infinity;
  private asked_until_ms = -Infinity;

  down(at_ms: number): void {
    this.down_ms = at_ms;
    this.waited = false;
  }
  /// The finger slid away, or the browser took the press for something else.
  left(): void {
    this.down_ms = null;
  }
  /// Whether it was down long enough; it is up now.
  held_until(up_ms: number): boolean {
    const held = this.down_ms !== null && up_ms - this.down_ms >= HOLD_MS;
    if (held) this.done();
    return held;
  }
  /// The timer of a hold that was due at `due_ms` has rung. Where it rang late the page slept, and the finger may be up with its event still waiting:
  /// once more `wait`.
  rings(due_ms: number, now_ms: number): 'fire' | 'wait' | 'nothing' {
    if (this.down_ms === null) return 'nothing';
    if (now_ms - due_ms > LATE_MS && !this.waited) {
      this.waited = true;
      return 'wait';
    }
    this.done();
    return 'fire';
  }
  /// The question is put; nobody sees it before `shown`.
  ask(now_ms: number): void {
    this.asked_ms = now_ms;
    this.asked_until_ms = Infinity;
  }
  shown(now_ms: number): void {
    if (this.asked_until_ms === Infinity) this.asked_until_ms = now_ms + CONFIRM_MS; // else it is answered already
  }
  /// Whether a tap answers the question: made after it was put, and not too late to have been meant for it.
  confirms(tap_ms: number): boolean {
    const yes = tap_ms > this.asked_ms && tap_ms <= this.asked_until_ms;
    if (yes) this.done();
    return yes;
  }
  /// What is done once answers every question of this press.
  private done(): void {
    this.down_ms = null;
    this.asked_until_ms = -Infinity;
  }
}
