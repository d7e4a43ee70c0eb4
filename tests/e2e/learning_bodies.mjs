// Requests of training runs on the data set 'set' that several tests send.

export const values = (n, from, step) => Array.from({ length: n }, (_, i) => Number((from * step ** i).toPrecision(6)));

/** A grid that takes minutes: whatever interrupts it does so half-way. */
export const endless = {
  task: 'nlos_id',
  dataset: 'set',
  methods: ['svm'],
  cv: { folds: 4, seed: 7 },
  importance: false,
  grid: { svm: { c: values(90, 0.1, 1.1), gamma: values(90, 0.001, 1.1) } },
};
/** Done within seconds. */
export const quick = {
  task: 'nlos_id',
  dataset: 'set',
  methods: ['logistic', 'random_forest'],
  cv: { folds: 4, seed: 7 },
};
