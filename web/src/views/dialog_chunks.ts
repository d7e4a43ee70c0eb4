/// The dialogs of the Anchors view, each a chunk of its own.
export const load_publish = () => import('./publish').then((m) => m.Publish);
export const load_compare = () => import('./compare_calibrations').then((m) => m.CompareCalibrations);
