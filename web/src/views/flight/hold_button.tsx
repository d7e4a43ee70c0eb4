/// One control for what must not happen by a slip: hold it for a second, or tap it and tap again within four.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { CONFIRM_MS, HOLD_MS, Press } from './press';

export function HoldButton({
  children,
  onConfirm,
  disabled,
  note,
  why = '',
  testid,
}: {
  children: ComponentChildren;
  onConfirm: () => void;
  disabled: boolean;
  note: string;
  why?: string; ///< why it is disabled
  testid: string;
}) {
  const [holding, set_holding] = useState(false),
    [asked_ms, set_asked_ms] = useState<number | null>(null), // each question has its own time on the screen
    asked = asked_ms !== null,
    press = useRef(new Press()).current,
    timer = useRef<ReturnType<typeof setTimeout>>(),
    tapped_ms = useRef<number | null>(null),
    fired = useRef(false),
    dead = useRef(disabled);
  dead.current = disabled;
  useEffect(() => () => clearTimeout(timer.current), []);
  useEffect(() => {
    if (asked_ms === null) return;
    press.shown(performance.now());
    const t = setTimeout(() => set_asked_ms(null), CONFIRM_MS);
    return () => clearTimeout(t);
  }, [asked_ms, press]);
  const fire = (): void => {
    fired.current = true;
    set_holding(false);
    set_asked_ms(null);
    if (!dead.current) onConfirm(); // control may have gone while it was held
  };
  const ring_in = (ms: number): void => {
    const due_ms = performance.now() + ms;
    timer.current = setTimeout(() => {
      const what = press.rings(due_ms, performance.now());
      if (what === 'fire') fire();
      else if (what === 'wait') ring_in(0);
    }, ms);
  };
  const down = (e: PointerEvent): void => {
    if (disabled) return;
    fired.current = false;
    tapped_ms.current = e.timeStamp;
    press.down(e.timeStamp);
    set_holding(true);
    ring_in(HOLD_MS);
  };
  const release = (): void => {
    clearTimeout(timer.current);
    press.left();
    set_holding(false);
  };
  const up = (e: PointerEvent): void => {
    const held = !fired.current && press.held_until(e.timeStamp);
    release();
    if (held) fire();
  };
  /// The click that ends a long press has already fired; a short one asks, or confirms what was asked. A key has no pointer before its click.
  const click = (e: MouseEvent): void => {
    const at_ms = tapped_ms.current ?? e.timeStamp;
    tapped_ms.current = null;
    if (fired.current) {
      fired.current = false;
      return;
    }
    if (press.confirms(at_ms)) {
      fire();
      fired.current = false; // no click follows that would be its own
      return;
    }
    const now_ms = performance.now();
    press.ask(now_ms);
    set_asked_ms(now_ms);
  };
  return (
    <button
      class={`cmd${holding ? ' holding' : ''}${asked ? ' asked' : ''}`}
      disabled={disabled}
      title={disabled && why ? why : undefined}
      data-testid={testid}
      onPointerDown={down}
      onPointerUp={up}
      onPointerLeave={release}
      onPointerCancel={release}
      onClick={click}
    >
      <svg class="ringbox" viewBox="0 0 36 36" aria-hidden="true">
        <circle class="under" cx="18" cy="18" r="15" />
        <circle class="fill" cx="18" cy="18" r="15" pathLength="1" />
      </svg>
      <span>
        <b>{children}</b>
        <small role="status">{asked ? 'tap again to confirm' : holding ? 'keep holding' : note}</small>
      </span>
    </button>
  );
}
