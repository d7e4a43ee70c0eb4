/// One control for what must not happen by a slip: hold it for a second, or tap it and tap again within four.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';

const HOLD_MS = 1000,
  CONFIRM_MS = 4000;

export function HoldButton({
  children,
  onConfirm,
  disabled,
  note,
  testid,
}: {
  children: ComponentChildren;
  onConfirm: () => void;
  disabled: boolean;
  note: string;
  testid: string;
}) {
  const [holding, set_holding] = useState(false),
    [asked, set_asked] = useState(false),
    timer = useRef<ReturnType<typeof setTimeout>>(),
    began = useRef(0),
    fired = useRef(false);
  useEffect(() => () => clearTimeout(timer.current), []);
  useEffect(() => {
    if (!asked) return;
    const t = setTimeout(() => set_asked(false), CONFIRM_MS);
    return () => clearTimeout(t);
  }, [asked]);
  const fire = (): void => {
    fired.current = true;
    set_holding(false);
    set_asked(false);
    onConfirm();
  };
  const press = (): void => {
    if (disabled) return;
    fired.current = false;
    began.current = performance.now();
    set_holding(true);
    timer.current = setTimeout(fire, HOLD_MS);
  };
  const release = (): void => {
    clearTimeout(timer.current);
    set_holding(false);
  };
  /// The click that ends a long press has already fired; a short one asks, or confirms what was asked.
  const click = (): void => {
    if (fired.current) {
      fired.current = false;
      return;
    }
    if (asked) fire();
    else set_asked(true);
  };
  return (
    <button
      class={`cmd${holding ? ' holding' : ''}${asked ? ' asked' : ''}`}
      disabled={disabled}
      data-testid={testid}
      onPointerDown={press}
      onPointerUp={release}
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
