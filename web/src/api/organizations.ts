/// Whose sites: the customers of a centre, and what each may store and ask.
import { idempotency_key } from './client';
import { call, get, list, type Wire } from './contract';

export type Organization = Wire<'Organization'>;
export type Quota = Wire<'OrganizationQuota'>;
export type Limits = Wire<'OrganizationLimits'>;
export type SiteOf = Pick<Wire<'Site'>, 'id' | 'name' | 'organization'>;

const MERGE = 'application/merge-patch+json';
const MOST = 1000; // of a page; beyond it the command line and REST have all

export const organizations = (): Promise<Organization[]> => list('/organizations', { query: { limit: MOST } });
export const create_organization = (name: string): Promise<unknown> =>
  call('post', '/organizations', { body: { name }, headers: { 'Idempotency-Key': idempotency_key() } });
export async function rename_organization(id: string, name: string, description: string | null): Promise<void> {
  const at = { path: { id } },
    { etag } = await call('get', '/organizations/{id}', at);
  await call('patch', '/organizations/{id}', {
    ...at,
    body: { name, description },
    headers: { 'If-Match': etag, 'Content-Type': MERGE },
  });
}
export async function remove_organization(id: string): Promise<void> {
  const at = { path: { id } },
    { etag } = await call('get', '/organizations/{id}', at);
  await call('delete', '/organizations/{id}', { ...at, headers: { 'If-Match': etag } });
}

export const quota_of = (id: string): Promise<Quota> => get('/organizations/{id}/quota', { path: { id } });
export const set_limits = (id: string, body: Limits): Promise<unknown> =>
  call('put', '/organizations/{id}/quota', { path: { id }, body });

/// Of every organization, and of none.
export const sites_of_all = (): Promise<SiteOf[]> =>
  list('/sites', { query: { limit: MOST, fields: 'id,name,organization' } });
/// null: into none.
export async function move_site(id: string, organization: string | null): Promise<void> {
  const at = { path: { id } },
    { etag } = await call('get', '/sites/{id}', at);
  await call('patch', '/sites/{id}', {
    ...at,
    body: { organization },
    headers: { 'If-Match': etag, 'Content-Type': MERGE },
  });
}
