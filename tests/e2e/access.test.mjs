// Who may see what, on the dashboard of a centre: organizations with sites, limits and tokens. Real server, its own refusals.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { openBrowser, openPage, picture, text, violations } from './browser.mjs';
import { startServer } from './server.mjs';

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

test('an organization gets sites, limits and a token that sees those sites, and goes when it has none', async () => {
  const site = await (await server.fetch('/api/v1/sites', { json: { name: 'Depot' } })).json();
  assert.equal((await server.fetch('/api/v1/sites', { json: { name: 'Harbour' } })).status, 201);
  const { page, seen, id } = await openPage(browser, server, { hash: '#/system' });
  await id('organization-name').fill('North Retail');
  await id('create-organization').click();
  await id('organization').getByRole('button', { name: 'Details' }).click();
  await id('organization-add-site').selectOption({ label: 'Depot' });
  await id('organization-sites').getByRole('listitem').filter({ hasText: 'Depot' }).waitFor();
  await id('organization-edit').click();
  await id('limit-sites').fill('one');
  await id('organization-save').click();
  await id('organization-detail').getByText('Sites: “one” is not a whole number').waitFor();
  await id('limit-sites').fill('1');
  await id('limit-requests_per_minute').fill('600');
  await id('organization-save').click();
  await id('organization-use').getByText('REACHED').waitFor();
  assert.match(await text(id('organization-use')), /Sites1 of 1 REACHED.*Flights0 no limit.*minuteat most 600/);
  const [firm] = (await get('/api/v1/organizations')).items;
  assert.deepEqual((await get(`/api/v1/organizations/${firm.id}/quota`)).limits, {
    sites: 1,
    missions: null,
    measurements: null,
    anchors: null,
    requests_per_minute: 600,
  });
  // The server's own refusal is said where the site was chosen.
  await id('organization-add-site').selectOption({ label: 'Harbour' });
  await id('organization-detail').locator('.problem').filter({ hasText: 'sites' }).waitFor();
  assert.deepEqual(await violations(page), []);
  await picture(page, 'organizations');

  await id('access').getByPlaceholder('who or what will use it').fill('their facility tool');
  await id('token-organization').selectOption({ label: 'those of North Retail' });
  await id('create-token').click();
  await id('secret').waitFor();
  await id('access').getByText('of North Retail', { exact: true }).waitFor();
  const token = (await get('/api/v1/tokens')).items.find((t) => t.name === 'their facility tool');
  assert.deepEqual([token.organization, token.sites], [firm.id, [site.id]]);
  await id('access')
    .getByRole('row', { name: /their facility tool/ })
    .getByRole('button')
    .click();
  await id('access').getByRole('button', { name: 'Press again to revoke' }).click();

  await id('organization-sites').getByRole('button', { name: 'Take out' }).click();
  await id('organization-sites')
    .getByRole('button', { name: /Press again/ })
    .click();
  await id('organization-sites').getByText('None yet.').waitFor();
  await id('organization-detail').getByRole('button', { name: 'Remove' }).click();
  await id('organization-detail').getByRole('button', { name: 'Press again to remove' }).click();
  await id('organizations').getByText('There are none').waitFor();
  assert.deepEqual(
    seen.errors.filter((e) => !/40[39]|507/.test(e)),
    [],
  );
  await page.close();
});
