/// What a side elevation is drawn from.
import type { Content } from './picture';

export interface ElevationProps {
  readonly content: () => Content;
  readonly onSelect: (anchor: string) => void;
  readonly version: unknown;
  readonly zero?: string | undefined; ///< what heights count from where the ground is not known
}
