/// Which dialog of the Anchors view is open.
import { signal } from '@preact/signals';

export const publish_open = signal(false);
export const compare_open = signal(false);
