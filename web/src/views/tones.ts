import type { AnchorStatus } from '../live/messages';
import { STATUS_LOOK, type Tone } from '../ui/marks';

export const status_tone = (s: AnchorStatus): Tone => STATUS_LOOK[s][1];
