// The operator in the browser flies: plan drawn and generated, checklist, start, anchors found, hold, resume, land, report. Real server, the
// simulated aircraft at the other end of MAVLink, its tag and rover through REST; in real time, so only the beginning of a flight.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createSocket } from 'node:dgram';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { binary, eventually, startServer } from './server.mjs';

let server, aircraft, browser, mission;
const get = async (path) => (await server.fetch(path)).json();
const procedure = () => get(`/api/v1/missions/${mission}/procedure`);

before(async () => {
  const socket = createSocket('udp4');
  await new Promise((done) => socket.bind(0, '127.0.0.1', done));
  const { port } = socket.address();
  await new Promise((done) => socket.close(done));
  server = await startServer({ auth: 'off', args: ['--drone-address', `udp://:${port}`] });
  let said = '';
  aircraft = spawn(binary, ['simulate', 'drone', '--mavlink', `udp://127.0.0.1:${port}`, '--url', server.url, '--ready', '2'], { stdio: ['ignore', 'ignore', 'pipe'] });
  aircraft.stderr.setEncoding('utf8').on('data', (chunk) => (said += chunk));
  mission = await eventually('the aircraft makes its mission', () => /mission ([0-9a-f-]{36})/.exec(said)?.[1]);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  aircraft?.kill('SIGINT');
  await server?.dispose();
});

/** Held for a second, as a gloved finger does. */
async function hold(page, button) {
  await button.scrollIntoViewIfNeeded();
  const box = await button.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await new Promise((done) => setTimeout(done, 1200));
  await page.mouse.up();
}

test('a plan is imported as an outline, generated and saved', async () => {
  const { page, id } = await openPage(browser, server, { hash: '#/plan' });
  const outline = { type: 'Feature', properties: { kind: 'outline' }, geometry: { type: 'Polygon', coordinates: [[[3.7131, 51.0231], [3.7135275, 51.0231], [3.7135275, 51.0232799], [3.7131, 51.0232799], [3.7131, 51.0231]]] } };
  await page.getByLabel('Plan file').setInputFiles({ name: 'hall.geojson', mimeType: 'application/geo+json', buffer: Buffer.from(JSON.stringify({ type: 'FeatureCollection', features: [outline] })) });
  await eventually('the outline is there', async () => id('generate').isEnabled());
  await id('generate').click();
  await id('waypoints').locator('tbody tr').nth(3).waitFor({ timeout: 30_000 });
  await id('save').click();
  await id('plan').getByText('revision 1').waitFor();
  await page.close();
});

test('start is blocked until the checklist is green; then the aircraft flies, holds at one press, goes on, and lands', async () => {
  const { page, seen, id } = await openPage(browser, server);
  await id('open-checklist').click({ timeout: 20_000 });
  await id('check-props').waitFor();
  assert.equal(await id('cmd-start').isEnabled(), false);
  await eventually('RTK is fixed for 10 s', async () => /ok|green/.test(await text(id('check-rtk').locator('.sr'))), 60_000, 500);
  const { items } = await get(`/api/v1/missions/${mission}/checklist?plan=${(await get('/api/v1/plans')).items[0].id}`);
  for (const item of items.filter((i) => i.manual)) await id(`check-${item.id}`).getByRole('button', { name: 'Confirm' }).click();
  for (const item of items.filter((i) => i.state === 'failed')) {
    await id(`check-${item.id}`).getByRole('button', { name: 'Override' }).click();
    await id(`check-${item.id}`).getByRole('textbox').fill('a test on the ground');
    await id(`check-${item.id}`).getByRole('button', { name: 'Override' }).click();
  }
  assert.deepEqual(await violations(page), []);
  await picture(page, 'checklist-light');
  await eventually('start is free', async () => id('cmd-start').isEnabled());
  await hold(page, id('cmd-start'));
  await id('procedure').getByText('RUNNING', { exact: true }).waitFor({ timeout: 20_000 });
  await eventually('anchors are heard', async () => (await procedure()).anchors.length > 3, 60_000, 250);
  await eventually('it is at work at a point', async () => (await procedure()).iteration > 0, 60_000, 250);
  await picture(page, 'flight-light');
  assert.deepEqual(await violations(page), []);
  await page.keyboard.press('h');
  await id('procedure').getByText('HOLD', { exact: true }).waitFor({ timeout: 10_000 });
  await eventually('the autopilot holds', async () => (await procedure()).drone.mode === 'BRAKE', 10_000);
  await hold(page, id('cmd-resume'));
  await id('procedure').getByText('RUNNING', { exact: true }).waitFor({ timeout: 10_000 });
  // A short tap asks, a second one confirms: nothing needs a steady finger.
  await id('cmd-land').click();
  await id('cmd-land').getByText('tap again').waitFor();
  await id('cmd-land').click();
  await id('procedure').getByText('DONE', { exact: true }).waitFor({ timeout: 60_000 });
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('who only watches sees who has control, and can start nothing', async () => {
  const taken = await server.fetch(`/api/v1/missions/${mission}/control`, { json: { action: 'take', force: true } });
  assert.equal(taken.status, 200);
  const { page, id } = await openPage(browser, server);
  await id('control').getByText('has control, since').waitFor();
  assert.equal(await id('open-checklist').isEnabled(), false);
  await page.close();
});
