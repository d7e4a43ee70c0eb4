/// Which dialog of the Anchors view is open. The dialogs come in chunks of their own.
import { signal } from '@preact/signals';

export const publish_open = signal(false);
export const compare_open = signal(false);
export const load_publish = () => import('./publish').then((m) => m.Publish);
export const load_compare = () => import('./compare_calibrations').then((m) => m.CompareCalibrations);
