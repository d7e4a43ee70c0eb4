/// Flights and sites as files: out of one server, into another.
import { idempotency_key } from './client';
import { call, url, type Wire } from './contract';

export type Imported = Wire<'ImportedBundle'>;
const at = (id: string): { readonly path: { readonly id: string } } => ({ path: { id } });
export const flight_bundle_url = (id: string): string => url('/missions/{id}/bundle', at(id));
export const site_bundle_url = (id: string): string => url('/sites/{id}/bundle', at(id));

/// The server says which of the two it is.
export const import_bundle = async (file: Blob): Promise<Imported> =>
  (
    await call('post', '/bundles', {
      file: { type: 'application/vnd.anchord.bundle+zip', data: file },
      headers: { 'Idempotency-Key': idempotency_key() },
    })
  ).body;
