// The plan of a floor in the browser: sent, placed by clicked points with their residuals, under the map of the plan, traced, its outline taken over.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
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
  await id('open-floor-plan').click();
  await id('floor-building').fill('B1');
  await id('floor-name').fill('Ground floor');
  await id('make-floor').click();
  await id('plan-file').setInputFiles({ name: 'no.pdf', mimeType: 'application/pdf', buffer: Buffer.from('%PDF-1.7') });
  await id('floor-plan').getByText('PNG, JPEG, (Geo)TIFF or ASCII DXF').waitFor();
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
