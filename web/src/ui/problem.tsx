/// Why something that was asked for did not happen; nothing where there is no reason.
import type { ComponentChildren } from 'preact';

export function Problem({ text, children }: { text: string; children?: ComponentChildren }) {
  return text ? (
    <div class="problem" role="status">
      <b>That did not work.</b> {text}
      {children}
    </div>
  ) : null;
}
