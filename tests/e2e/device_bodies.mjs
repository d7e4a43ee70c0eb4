// Bodies of the contract test: settings of devices that are nowhere, which are set up, changed and removed without one; the quota of a site.

export const rover = {
  kind: 'gnss',
  name: 'rover',
  address: 'serial:/dev/serial/by-id/of-the-contract-test',
  options: { format: 'nmea' },
};
export const caster = { kind: 'ntrip', address: 'tcp://127.0.0.1:1', options: { mount: 'M' }, enabled: false };

/** Of each method. */
export const quota = {
  GET: { expect: 200 },
  PUT: { expect: 200, json: { missions: 1000, measurements: null, anchors: null } },
};
