/// A button with a list below it; Escape and a tap elsewhere close it. What a toolbar has no room for in one row goes into one.
import type { ComponentChildren } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { useDialog } from '../ui/use_dialog';

interface Props {
  words: string; ///< on the button
  label: string; ///< of the list
  id: string; ///< test id of the button; the list has `<id>-list`
  help: string; ///< page of the guide
  narrow?: boolean; ///< as wide as what is in it
  children: ComponentChildren;
}

export function PopList({ words, label, id, help, narrow = false, children }: Props) {
  const [open, set_open] = useState(false),
    box = useRef<HTMLDivElement>(null),
    list = useDialog<HTMLDivElement>(() => set_open(false), help, open);
  useEffect(() => {
    if (!open) return;
    const away = (e: Event): void => {
      if (!(e.target instanceof Node && box.current?.contains(e.target))) set_open(false);
    };
    document.addEventListener('pointerdown', away);
    return () => document.removeEventListener('pointerdown', away);
  }, [open]);
  return (
    <div class="picker" ref={box}>
      <button class="btn" aria-expanded={open} data-testid={id} onClick={() => set_open(!open)}>
        {words}
      </button>
      {open && (
        <div class={`pop ${narrow ? 'narrow' : ''}`} {...list} aria-label={label} data-testid={`${id}-list`}>
          {children}
        </div>
      )}
    </div>
  );
}

/// Files of what is shown, one link a format.
export function Exports({ help, files }: { help: string; files: readonly (readonly [string, string, string])[] }) {
  return (
    <PopList words="Export" label="File formats" id="export" help={help} narrow>
      {files.map(([format, href, name]) => (
        <a key={format} class="btn" href={href} download={name} data-testid={format.toLowerCase().replace('.', '')}>
          {format}
        </a>
      ))}
    </PopList>
  );
}
