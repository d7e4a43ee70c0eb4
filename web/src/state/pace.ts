/// Pictures of a page that cannot keep up. The browser draws before it reads: while each picture takes half a second and the next is always due, what
/// the socket brought waits, and is old when it is worked in. After a long picture the next one waits as long as it took: half of the time is for reading.
import { options } from 'preact';

const LONG_MS = 150,
  LONGEST_REST_MS = 4000; ///< on a twelfth of a slow CPU a picture takes two to three seconds

/// When the next picture may begin. No DOM.
export class Pace {
  private begun_ms: number | null = null;
  private free_ms = -Infinity;
  private painting = false;
  begins(now_ms: number): void {
    this.begun_ms ??= now_ms;
  }
  /// Its frame has begun; style, layout and paint come after this and before the end.
  paints(): void {
    this.painting = this.begun_ms !== null;
  }
  ends(now_ms: number): void {
    this.painting = false;
    if (this.begun_ms === null) return;
    const took_ms = now_ms - this.begun_ms;
    this.begun_ms = null;
    if (took_ms > LONG_MS) this.free_ms = now_ms + Math.min(took_ms, LONGEST_REST_MS);
  }
  /// A timer may come before the task that ends a picture, however long that took: whoever asks then asks again.
  rest_ms(now_ms: number): number {
    return this.painting ? 1 : Math.max(0, this.free_ms - now_ms);
  }
}

const pace = new Pace(),
  ended = new MessageChannel(); // a task of its own: it comes after style, layout and paint
ended.port2.onmessage = () => pace.ends(performance.now());
function painted(): void {
  pace.paints();
  ended.port1.postMessage(null);
}

/// Calls `draw` once the page had its time to read; another picture may end meanwhile and begin a rest of its own.
function after_rest(draw: () => void): void {
  const wait_ms = pace.rest_ms(performance.now());
  if (wait_ms > 0) setTimeout(() => after_rest(draw), wait_ms);
  else draw();
}
/// A person begins something: what waits is drawn first, so that a handler works with all that was typed before it.
const BEGINS = ['pointerdown', 'pointermove', 'pointerup', 'keydown', 'beforeinput', 'submit', 'drop'];
/// Something was done and is drawn at once. Nothing is drawn before its handler: a form that is drawn now would take back what was just put in.
const DONE = ['click', 'keyup', 'input', 'change', 'hashchange', 'popstate'];
const hovers = (e: Event): boolean => e.type === 'pointermove' && (e as PointerEvent).buttons === 0;

/// From now on components are drawn anew only when the page had time to read, since many messages change something of some of them; at once where
/// a person did something.
export function pace_components(page: EventTarget = globalThis): void {
  let waiting: (() => void) | null = null,
    at_once = false;
  const draw = (): void => {
    const render = waiting;
    if (!render) return;
    waiting = null;
    pace.begins(performance.now());
    requestAnimationFrame(painted);
    render();
  };
  options.debounceRendering = (render) => {
    waiting = render;
    queueMicrotask(at_once ? draw : () => after_rest(draw));
  };
  const hurry = (): void => {
    at_once = true;
    setTimeout(() => {
      at_once = false;
      draw(); // also what joined a picture that was waiting
    });
  };
  const begins = (e: Event): void => {
    if (hovers(e)) return;
    draw();
    hurry();
  };
  for (const kind of BEGINS) page.addEventListener(kind, begins, { capture: true, passive: true });
  for (const kind of DONE) page.addEventListener(kind, hurry, { capture: true, passive: true });
}
/// As requestAnimationFrame, once the page had time to read.
export function next_picture(draw: (t_ms: number) => void): void {
  after_rest(() =>
    requestAnimationFrame((t_ms) => {
      pace.begins(performance.now());
      painted();
      draw(t_ms);
    }),
  );
}
