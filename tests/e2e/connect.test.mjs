// The first set-up in the browser, from an empty server: the way to the form, the fields of every kind of device, errors at the field that has
// them, and what of a typed form is still there after a reload. Real server; no device is at the other end.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { free_udp_port } from './ports.mjs';
import { eventually, startServer } from './server.mjs';

let browser, server;
const get = async (path) => (await server.fetch(path)).json();

before(async () => {
  server = await startServer({ auth: 'off' });
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
});

/** By test id, or by the words beside it where it has none. */
const fields = {
  pozyx: [
    'device-path',
    /^Anchors to range to/,
    'Impulse response',
    /^Seconds between ranges/,
    /Heading from its compass/,
  ],
  dwm1001: ['device-path', 'device-mode', 'device-tag'],
  mqtt: [
    'device-host',
    'device-port',
    'device-payload',
    'device-topic',
    'device-user',
    'device-password',
    'device-mapping',
  ],
  ndjson: ['device-path', 'Baud rate', 'device-mapping'],
  gnss: ['device-path', 'Baud rate', 'Format', 'device-corrections', /^Latency of receiver/],
  ntrip: [
    'device-host',
    'device-port',
    'device-mount',
    /^User$/,
    'device-password',
    'NTRIP version',
    /Send the position/,
  ],
};
const of_any = [...new Set(Object.values(fields).flat())];

/** A UDP port that nobody has. */
async function form(options = {}) {
  const opened = await openPage(browser, server, { hash: '#/system/connect', ...options });
  await opened.id('add-device').click();
  await opened.id('device-form').waitFor();
  return opened;
}
const field = ({ id }, name) =>
  typeof name === 'string' && name.startsWith('device-')
    ? id('device-form').getByTestId(name)
    : id('device-form').getByLabel(name);

test('from an empty server the way leads to the form, and every kind of device has its own fields and no others', async () => {
  const { page, seen, id } = await openPage(browser, server);
  await id('connect-devices').click();
  await id('connect-steps').waitFor();
  assert.equal(await id('step-find').getAttribute('data-state'), 'now');
  assert.deepEqual(await violations(page, { sizes: true }), []);
  await id('add-device').click();
  const kinds = await id('device-kind')
    .locator('option')
    .evaluateAll((all) => all.map((o) => o.value));
  assert.deepEqual([...kinds].sort(), Object.keys(fields).sort());
  for (const kind of kinds) {
    await id('device-kind').selectOption(kind);
    const there = fields[kind];
    for (const name of there) await field({ id }, name).first().waitFor({ timeout: 3000 });
    for (const name of of_any.filter((n) => !there.some((t) => String(t) === String(n))))
      if (typeof name === 'string') assert.equal(await field({ id }, name).count(), 0, `${kind} has no ${name}`);
    assert.ok(await id('device-send').isDisabled(), `${kind}: nothing is typed yet`);
    assert.deepEqual(await violations(page), [], kind);
    await picture(page, `connect-${kind}`);
  }
  await page.getByRole('button', { name: 'Not now' }).click();
  assert.deepEqual(
    (await get('/api/v1/devices')).items.filter((d) => d.id),
    [],
  );
  assert.deepEqual(seen.errors, []);
  await page.close();
});

test('what is missing is said before it is sent, what the server rejects stands at its field, and once right the device is there', async () => {
  const { page, id } = await form({ width: 768, height: 1024 });
  const lack = async (words) =>
    eventually(String(words), async () => words.test(await text(id('device-form').locator('.actions'))), 3000);
  await id('device-kind').selectOption('ndjson');
  await id('device-form').getByLabel('Link').selectOption('udp');
  await lack(/Which port number\?/);
  await id('device-port').fill('70000');
  await lack(/A port number is 1 to 65535/);
  const port = String(await free_udp_port());
  await id('device-port').fill(port);
  await lack(/Mapping: missing/);
  await id('device-mapping').fill('{"tag": "/id",}');
  await lack(/not valid JSON/);
  const mapping = { tag: '/id', anchor: '/to', distance: { pointer: '/mm', unit: 'mm' } };
  await id('device-mapping').fill(JSON.stringify({ ...mapping, surplus: 1 }));
  await id('device-send').click();
  await id('rejected-mapping').getByText('mapping/surplus').waitFor();
  const described = await id('device-mapping').getAttribute('aria-describedby');
  assert.equal(await id('device-mapping').getAttribute('aria-invalid'), 'true');
  assert.equal(await page.locator(`#${described}`).getAttribute('data-testid'), 'rejected-mapping');
  assert.deepEqual(await violations(page), []);
  await picture(page, 'connect-rejected');
  assert.deepEqual(
    (await get('/api/v1/devices')).items.filter((d) => d.id),
    [],
    'what is rejected is not kept',
  );
  await id('device-mapping').fill(JSON.stringify(mapping));
  await id('device-send').click();
  await id('device-form').waitFor({ state: 'detached' });
  const [made] = (await get('/api/v1/devices')).items.filter((d) => d.id);
  assert.deepEqual([made.kind, made.address, made.options.mapping], ['ndjson', `udp://:${port}`, mapping]);
  await eventually('the steps know it', async () => /1 device set up/.test(await text(id('step-find'))), 10_000);
  await page.close();
});

test('a form that was not sent is back after a reload, without its password, which this browser never kept', async () => {
  const { page, id } = await form();
  await id('device-kind').selectOption('ntrip');
  await id('device-host').fill('127.0.0.1');
  await id('device-port').fill('2101');
  await id('device-mount').fill('NEAR');
  await id('device-password').fill('correct horse');
  await page.reload();
  await id('add-device').click();
  assert.equal(await id('device-mount').inputValue(), 'NEAR');
  assert.equal(await id('device-password').inputValue(), '');
  const kept = await page.evaluate(() => JSON.stringify({ ...localStorage }));
  assert.match(kept, /NEAR/);
  assert.doesNotMatch(kept, /correct horse/);
  await page.getByRole('button', { name: 'Not now' }).click();
  assert.doesNotMatch(
    await page.evaluate(() => JSON.stringify({ ...localStorage })),
    /NEAR/,
    'thrown away with the form',
  );
  await page.close();
});
