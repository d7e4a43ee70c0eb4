/// The organizations of this server, for every panel that names one: read when one is shown, and again after a change.
import { signal } from '@preact/signals';
import { organizations as fetch_organizations, type Organization } from '../api/organizations';

/// null: not read yet.
export const organizations = signal<readonly Organization[] | null>(null);
export const read_organizations = async (): Promise<void> => {
  organizations.value = await fetch_organizations();
};
