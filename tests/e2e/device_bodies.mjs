// Settings of devices that are nowhere: what is set up, changed and removed without one.

export const rover = {
  kind: 'gnss',
  name: 'rover',
  address: 'serial:/dev/serial/by-id/of-the-contract-test',
  options: { format: 'nmea' },
};
export const caster = { kind: 'ntrip', address: 'tcp://127.0.0.1:1', options: { mount: 'M' }, enabled: false };
