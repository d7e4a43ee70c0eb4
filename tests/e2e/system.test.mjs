// Devices on the dashboard: simulated ones with faults, over real ptys and sockets, and a caster. What is wrong is said at a glance, with what to do, and
// what can be mended there is mended there.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { binary, eventually, startServer } from './server.mjs';

// The example of message 1005 in RTCM 10403: station 2003, ECEF 1114104.5999, -4850729.7108, 3975521.4643.
const RTCM_1005 = Buffer.from('d300133ed7d30202980edeef34b4bd62ac0941986f33360b98', 'hex');

let folder, simulator, server, browser, caster;
const made = {},
  served = {};
const get = async (path) => (await server.fetch(path)).json();
const add = async (name, json) => {
  const answer = await server.fetch('/api/v1/devices', { json: { name, ...json } });
  assert.equal(answer.status, 201, await answer.clone().text());
  made[name] = (await answer.json()).id;
};

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'anchord system '));
  const always = { from_s: 0, until_s: 1e5 };
  writeFileSync(
    join(folder, 'scenario.json'),
    JSON.stringify({
      schema: 'anchord.scenario/1',
      name: 'faults',
      seed: 5,
      tags: [
        { name: 'good', id: '0x6e01' },
        { name: 'refusing', id: '0x6e02' },
      ],
      rovers: [
        { name: 'rover', format: 'ubx', port: 'tcp', rate_hz: 5 },
        { name: 'cellar', format: 'nmea', port: 'tcp', rate_hz: 5 },
      ],
      faults: [
        { device: 'refusing', kind: 'refuse', ...always },
        { device: 'cellar', kind: 'fix_loss', ...always },
      ],
      radio: { loss_chance: 0, sensitivity_dbm: -130 },
    }),
  );
  simulator = spawn(binary, ['simulate', join(folder, 'scenario.json'), '--json', '--links', folder], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  await new Promise((done, fail) => {
    createInterface({ input: simulator.stdout }).on('line', (line) => {
      const device = JSON.parse(line);
      served[device.name] = device;
      if (Object.keys(served).length === 4) done();
    });
    simulator.once('exit', (code) => fail(new Error(`anchord simulate ended with ${code}`)));
  });
  caster = createServer((socket) => {
    socket.once('data', () => socket.write(Buffer.concat([Buffer.from('ICY 200 OK\r\n\r\n'), RTCM_1005])));
    const timer = setInterval(() => socket.write(RTCM_1005), 500);
    socket.on('error', () => undefined).on('close', () => clearInterval(timer));
  });
  await new Promise((done) => caster.listen(0, '127.0.0.1', done));
  server = await startServer();
  for (const name of ['good', 'cellar']) await add(name, { kind: served[name].kind, address: served[name].address });
  // A tag that refuses finds no anchors either: it is told whom to range to.
  await add('refusing', {
    kind: 'pozyx',
    address: served.refusing.address,
    options: { anchors: ['0x6a21', '0x6a22'] },
  });
  // As somebody in a hurry types it: a port on which nothing listens.
  await add('rover', { kind: 'gnss', address: 'tcp://127.0.0.1:9' });
  await add('same port', { kind: 'pozyx', address: `serial:${served.good.pty}` });
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
  simulator?.kill('SIGTERM');
  caster?.close();
  if (folder) rmSync(folder, { recursive: true, force: true });
});

const word = async (id, name) => text(id(`device-${made[name]}`).locator('.chip'));

test('each device says at a glance whether it works, and what to do where it does not', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  const expected = {
    good: 'WORKING',
    refusing: 'NO RANGES',
    cellar: 'NO FIX',
    rover: 'NEVER SEEN',
    'same port': 'PORT TWICE',
  };
  for (const [name, wanted] of Object.entries(expected))
    await eventually(`${name} is ${wanted}`, async () => (await word(id, name)) === wanted, 30_000, 200);
  assert.match(await text(id(`device-${made.refusing}`)), /refuses to range.*Reboot/);
  assert.match(await text(id(`device-${made['same port']}`)), /the same port as device "good"/);
  assert.match(await text(id('device-summary')), /4 need you.*1 working/);
  await id(`device-${made.refusing}`).getByTestId('details').click();
  await id('drops').getByText('the tag refused to range').waitFor();
  assert.deepEqual(await violations(page), []);
  await picture(page, 'devices-light');
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a wrong address is mended in its form, and the device works', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  await id(`device-${made.rover}`).getByTestId('details').click();
  await id('edit-device').click();
  await id('device-port').fill('70000');
  await id('device-form').getByText('A port number is 1 to 65535.').waitFor();
  assert.ok(await id('device-send').isDisabled());
  await id('device-port').fill(String(served.rover.port));
  await id('device-send').click();
  await eventually('the rover works', async () => (await word(id, 'rover')) === 'WORKING', 20_000, 200);
  assert.equal((await get(`/api/v1/devices/${made.rover}`)).address, served.rover.address);
  assert.match(await text(id(`device-${made.rover}`)), /FIX, \d+ satellites/);
  await eventually(
    "the time is the receiver's",
    async () => /TIME OF THE RECEIVER/.test(await text(id('clocks'))),
    30_000,
    200,
  );
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a caster is set up in the form, and tells where the base stands', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  await id('add-device').click();
  await id('device-kind').selectOption('ntrip');
  await id('device-host').fill('127.0.0.1');
  await id('device-port').fill(String(caster.address().port));
  assert.ok(await id('device-send').isDisabled(), 'no mount point yet');
  await id('device-mount').fill('NEAR');
  await id('device-send').click();
  await id('base-place').waitFor();
  // Of that ECEF by the textbook's iteration on WGS 84, apart from this code.
  const shown = (await text(id('base-place'))).replaceAll('\u202f', '');
  for (const part of ['38.804759430', '−77.064773600', '114.561', 'Station2003'])
    assert.ok(shown.includes(part), `${part} in ${shown}`);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a site is named with datum and base, and a device is forgotten by two presses', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  const form = id('base-form');
  await form.getByLabel('Name of the site').fill('yard');
  await form.getByLabel('Datum of its coordinates').fill('ETRS89');
  await form.getByLabel('Epoch, year').fill('2026,5');
  await id('base-source').selectOption('survey_in');
  await form.getByLabel('σ of its position, mm').fill('850');
  await id('base-send').click();
  await id('base').getByText('SURVEYED IN', { exact: true }).waitFor();
  const { crs } = (await get('/api/v1/sites')).items.find((s) => s.name === 'yard');
  assert.deepEqual([crs.frame, crs.epoch, crs.base], ['ETRS89', 2026.5, { source: 'survey_in', sigma_m: 0.85 }]);
  assert.match(await text(id('base')), /good to ±85 cm/);
  await id(`device-${made['same port']}`).getByTestId('details').click();
  await id('forget').click();
  assert.equal((await server.fetch(`/api/v1/devices/${made['same port']}`)).status, 200, 'one press asks');
  await id('forget').click();
  await eventually(
    'it is gone',
    async () => (await server.fetch(`/api/v1/devices/${made['same port']}`)).status === 404,
  );
  await id(`device-${made['same port']}`).waitFor({ state: 'detached' });
  assert.deepEqual(await violations(page), []);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('the radio of a tag is compared with every anchor in its reach', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  const row = id(`device-${made.good}`);
  await eventually('it works', async () => (await word(id, 'good')) === 'WORKING', 30_000, 200);
  await row.getByTestId('radio-open').click();
  await id('radio-compared').waitFor({ timeout: 30_000 });
  // Which of the six are in reach at this instant is the flight's; every one of them is accounted for.
  const told = await text(id('radio-compared')),
    { devices } = await get(`/api/v1/devices/${made.good}/uwb-settings?devices=true`);
  assert.ok(devices.length >= 3, JSON.stringify(devices));
  assert.match(told, /All \d anchors it knows have the same settings|\d of \d anchors could not be verified/);
  assert.deepEqual(await violations(page), []);
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('a flight begins on the page, records what the devices measure, is finished there, and the next one is declared alike', async () => {
  const { network_id: tag } = await get(`/api/v1/devices/${made.good}`),
    site = (await get('/api/v1/sites')).items.find((s) => s.name === 'yard').id;
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system/flight' });
  const form = id('new-flight'),
    arm = (axis) => form.getByLabel(`${tag} ${axis}, m`);
  await arm('Forward').waitFor();
  assert.ok(await id('begin-flight').isDisabled(), 'nobody has measured where the antenna is');
  await form.getByLabel('Name', { exact: true }).fill('South side');
  await form.getByLabel('Site').selectOption(site);
  await form.getByLabel('Kit').fill('quad');
  for (const input of await form.getByLabel(/(Forward|Left|Up), m$/).all()) await input.fill('0'); // the other tag is where the antenna is
  await arm('Forward').fill('0,12');
  await arm('Up').fill('-0.28');
  await form.getByLabel('Measured to, one sigma, m').fill('0.02');
  assert.ok(await id('begin-flight').isEnabled());
  assert.deepEqual(await violations(page, { sizes: true }), []);
  await picture(page, 'new-flight-light');
  await id('begin-flight').click();
  await id('progress').getByText('South side').waitFor();
  const [flight] = (await get('/api/v1/missions')).items,
    arm_of = ({ tags }) => tags.find((one) => one.tag === tag).lever_arm_body_m;
  assert.deepEqual(
    [flight.name, flight.site, flight.kit, flight.frame, flight.track_point, arm_of(flight), flight.lever_arm_sigma_m],
    ['South side', site, 'quad', 'wgs84', 'gnss_antenna', [0.12, 0, -0.28], 0.02],
  );
  await eventually('rows arrive', async () => (await id('range-list').locator('tbody tr').count()) >= 3, 30_000);
  assert.deepEqual(await violations(page), []);
  await picture(page, 'recording-light');
  await id('finish-recording').focus();
  await page.keyboard.press('Enter');
  await id('finish-recording').getByText('tap again').waitFor();
  assert.equal((await get(`/api/v1/missions/${flight.id}`)).state, 'recording', 'one press asks');
  await page.keyboard.press('Enter');
  await eventually('it is finished', async () => (await get(`/api/v1/missions/${flight.id}`)).state === 'finished');
  await id('next-flight').click();
  await eventually('as before', async () => (await arm('Up').inputValue()) === '-0.28');
  assert.equal(await form.getByLabel('Kit').inputValue(), 'quad');
  await eventually(
    'its site once the sites are read',
    async () => (await form.getByLabel('Site').inputValue()) === site,
  );
  assert.match(await form.getByLabel('Name', { exact: true }).inputValue(), /^Flight \d{4}-\d\d-\d\d \d\d:\d\d$/);
  assert.ok(await id('begin-flight').isEnabled());
  assert.deepEqual(seen.errors, []);
  await page.close();
});
