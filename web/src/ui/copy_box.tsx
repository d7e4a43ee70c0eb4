import { useRef, useState } from 'preact/hooks';
import { Icon } from './marks';

/// Text to take away. The clipboard exists in secure contexts only, so the box also selects itself for Ctrl+C.
export function CopyBox({ text, label = 'Copy' }: { text: string; label?: string }) {
  const box = useRef<HTMLInputElement>(null);
  const [done, set_done] = useState('');
  const copy = (): void => {
    box.current?.select();
    if (navigator.clipboard)
      navigator.clipboard.writeText(text).then(
        () => set_done('Copied'),
        () => set_done('Selected: press Ctrl+C'),
      );
    else set_done('Selected: press Ctrl+C');
  };
  return (
    <div class="copybox">
      <input ref={box} readOnly value={text} aria-label={label} onFocus={(e) => e.currentTarget.select()} />
      <button class="btn" onClick={copy} aria-label={label}>
        <Icon name="copy" />
      </button>
      <span role="status" class="mut">
        {done}
      </span>
    </div>
  );
}
