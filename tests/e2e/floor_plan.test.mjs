// The plan of a floor in the browser: sent, placed by clicked points with their residuals, under the map of the plan, traced, its outline taken over.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, opensByKeys, picture, text, violations } from './browser.mjs';
import { room_png } from './room.mjs';
import { eventually, startServer } from './server.mjs';

let browser, server;
before(async () => {
  server = await startServer({ auth: 'off' });
  const made = await server.fetch('/api/v1/sites', { json: { name: 'Ghent', origin: { lon: 3.7, lat: 51, h_m: 50 } } });
  assert.equal(made.status, 201);
  browser = await openBrowser();
});
after(async () => {
  await browser?.close();
  await server?.dispose();
});

// 2 cm a pixel, north up, pixel (0, 0) at the site's origin; WGS84's radii at 51 degrees.
const place = (x, y) => {
  const lat = 51 - (y * 0.02) / 111_248.3,
    lon = 3.7 + (x * 0.02) / 70_197.4;
  return `${lat.toFixed(9)}, ${lon.toFixed(9)}`;
};

test('a person sends a plan, clicks points, sees residuals, places it, traces it, and draws by its outline', async () => {
  const { page, seen, id } = await openPage(browser, server, { hash: '#/plan' });
  await eventually('LIVE', async () => (await text(id('status-link'))).includes('LIVE'), 20_000);
  await id('where').fill('51.0000, 3.7000');
  await id('where').press('Enter');
  await id('plan-map').waitFor();
  assert.equal(await id('level').count(), 0, 'no plan is placed: nothing to choose');
  await opensByKeys(page, id('open-floor-plan'), id('floor-plan'));
  await id('open-floor-plan').click();
  await id('floor-building').fill('B1');
  await id('floor-name').fill('Ground floor');
  await id('make-floor').click();
  await id('plan-file').setInputFiles({ name: 'no.svg', mimeType: 'image/svg+xml', buffer: Buffer.from('<svg/>') });
  await id('floor-plan').getByText('PNG, JPEG, (Geo)TIFF, PDF or ASCII DXF').waitFor();
  await id('plan-file').setInputFiles({ name: 'no.pdf', mimeType: 'application/pdf', buffer: Buffer.from('%PDF-1.7') });
  await id('floor-plan').getByText('pdfinfo failed').waitFor();
  await id('plan-file').setInputFiles({ name: 'room.png', mimeType: 'image/png', buffer: room_png() });
  const shown = id('plan-picture');
  await eventually('the picture is there', () => shown.evaluate((i) => i.complete && i.naturalWidth === 800));
  const points = [
    [100, 100],
    [700, 100],
    [700, 500],
    [100, 500],
  ];
  for (const [i, [x, y]] of points.entries()) {
    const box = await shown.boundingBox();
    await shown.click({ position: { x: (x / 800) * box.width, y: (y / 600) * box.height } });
    await id(`place-${i + 1}`).fill(i === 2 ? place(x + 150, y) : place(x, y)); // 3 m off
    if (i !== 2) continue;
    // Three points alone only disagree; the wall between the first two, as measured, shows which is wrong.
    await id('fit').getByText('cannot show which one').waitFor();
    await id('known-length').fill('twelve');
    await id('place-plan').and(page.locator(':disabled')).waitFor();
    await id('known-length').fill('12,00');
    await eventually('the wrong one of three is named', async () => (await text(id('residual-3'))).includes('wrong'));
    await id('known-length').fill('');
  }
  await eventually('the wrong one is named', async () => (await text(id('residual-3'))).includes('wrong'));
  await id('fit').getByText('point 3').waitFor();
  await id('place-3').fill(place(700, 500));
  await eventually('they agree', async () => /^0\.0\d m$/.test(await text(id('residual-3'))));
  assert.deepEqual(await violations(page), []);
  await picture(page, 'floor-plan');
  await id('place-plan').click();
  await id('level').waitFor();
  await eventually('the plan lies under the map', () =>
    id('under-plan').evaluate((c) =>
      c
        .getContext('2d')
        .getImageData(0, 0, c.width, c.height)
        .data.some((v) => v > 0),
    ),
  );
  const [floor] = (await (await server.fetch('/api/v1/floors')).json()).items;
  assert.ok(Math.abs(floor.georeference.scale_m_per_px - 0.02) < 2e-4, `${floor.georeference.scale_m_per_px}`);
  await id('trace').click();
  await id('traced').getByText('4 corners and 4 walls').waitFor({ timeout: 60_000 });
  await page.getByRole('button', { name: 'Accept walls' }).click();
  await eventually('the walls are kept', async () => {
    const [kept] = (await (await server.fetch('/api/v1/floors')).json()).items;
    return kept.n_walls === 4;
  });
  await id('use-outline').click();
  await page.keyboard.press('Escape');
  await id('plan-name').fill('Room');
  await id('save').click();
  await id('plan').getByText('revision 1').waitFor();
  const [stored] = (await (await server.fetch('/api/v1/plans')).json()).items;
  assert.equal(stored.outline.coordinates[0].length, 5);
  await id('level').selectOption('');
  await eventually('it can be put away', () =>
    id('under-plan').evaluate(
      (c) =>
        !c
          .getContext('2d')
          .getImageData(0, 0, c.width, c.height)
          .data.some((v) => v > 0),
    ),
  );
  // The refused files were asked for on purpose.
  assert.deepEqual(
    seen.errors.filter((line) => !/415|422/.test(line)),
    [],
  );
});

/** A sheet of 420 x 297 mm with a room of 12 x 8 m at 1:50, turned by 7 degrees, with what else stands on a plan. Millimetres of paper. */
const sheet = `<svg xmlns="http://www.w3.org/2000/svg" width="420mm" height="297mm" viewBox="0 0 420 297" style="position:absolute;left:0;top:0">
  <g transform="rotate(7 210 150)" font-size="5" font-family="sans-serif">
    <rect x="93" y="73" width="234" height="154" fill="none" stroke="black" stroke-width="6"/>
    <rect x="120" y="100" width="40" height="24" fill="none" stroke="black" stroke-width="0.3"/>
    <circle cx="250" cy="180" r="9" fill="none" stroke="black" stroke-width="0.3"/>
    <text x="180" y="150">Hall 96 m2</text>
    <path d="M90 60 H330 M90 57 V63 M330 57 V63" stroke="black" stroke-width="0.2" fill="none"/>
  </g></svg>`;

test('a PDF that Chromium printed is a plan: its second page, placed by three points, and the room of it traced', async () => {
  const page = await browser.context.newPage();
  await page.setContent(
    `<style>@page{size:420mm 297mm;margin:0}body{margin:0}</style><p>Title</p><div style="break-before:page;position:relative;height:290mm">${sheet}</div>`,
  );
  const pdf = await page.pdf({ width: '420mm', height: '297mm', printBackground: true, preferCSSPageSize: true });
  await page.close();
  const send = async (method, path, options) => {
    const answer = await server.fetch(path, { method, ...options });
    assert.ok(answer.ok, `${method} ${path}: ${answer.status} ${await answer.clone().text()}`);
    return { json: await answer.json(), etag: answer.headers.get('etag') };
  };
  const [building] = (await send('GET', '/api/v1/buildings')).json.items;
  const floor = await send('POST', '/api/v1/floors', { json: { building: building.id, name: 'Printed', level: 1 } });
  const path = `/api/v1/floors/${floor.json.id}/plan`;
  const one_page = { body: pdf, headers: { 'content-type': 'application/pdf', 'if-match': floor.etag } };
  const none = await server.fetch(`${path}?page=3`, { method: 'PUT', ...one_page });
  assert.equal(none.status, 422, await none.clone().text());
  assert.match(await none.text(), /has 2 pages and no page 3/);
  const sent = await send('PUT', `${path}?page=2`, one_page);
  const { width_px, height_px } = sent.json.plan;
  assert.ok(
    Math.abs(width_px - (420 / 25.4) * 200) < 3 && Math.abs(height_px - (297 / 25.4) * 200) < 3,
    `${width_px} x ${height_px}`,
  );
  // 1:50: a millimetre of paper is 5 cm. Corners of the sheet, north up.
  const points = [
    [0, 0],
    [width_px, 0],
    [0, height_px],
  ].map(([x, y]) => ({ pixel: [x, y], enu_m: [(x / width_px) * 21, -(y / height_px) * 14.85] }));
  await send('PUT', `${path}/georeference`, { json: { points }, headers: { 'if-match': sent.etag } });
  const { json: traced } = await send('POST', `${path}/trace`, { json: {}, headers: { prefer: 'wait=200' } });
  const [ring] = traced.outline.coordinates;
  assert.equal(ring.length, 5, JSON.stringify(traced));
  const turned = [
    [90, 70],
    [330, 70],
    [330, 230],
    [90, 230],
  ].map(([x, y]) => {
    const a = (7 * Math.PI) / 180,
      u = x - 210,
      v = y - 150;
    return [(210 + u * Math.cos(a) - v * Math.sin(a)) / 20, -(150 + u * Math.sin(a) + v * Math.cos(a)) / 20];
  });
  for (const [lon, lat] of ring) {
    // WGS84's radii at 51 degrees, as above.
    const e = (lon - 3.7) * 70_197.4,
      n = (lat - 51) * 111_248.3;
    const apart = Math.min(...turned.map(([x, y]) => Math.hypot(e - x, n - y)));
    assert.ok(apart < 0.05, `${e} ${n} is ${apart} m from any corner`);
  }
});
