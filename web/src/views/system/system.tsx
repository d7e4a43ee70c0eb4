/// System: the devices of this server, whether it is well, who may use it and what they did.
import { useEffect, useState } from 'preact/hooks';
import './system.css';
import { checks as fetch_checks, version as fetch_version, type Check, type Version } from '../../api/system';
import { may, of_every_site } from '../../state/session';
import { system } from '../../state/store';
import { NotLoaded, useLoad } from '../../ui/empty';
import { bytes, fixed, grouped } from '../../ui/format';
import { Chip } from '../../ui/marks';
import { Unknown } from '../../ui/unknown';
import { AccessPanel, AuditPanel } from './access';
import { BasePanel } from './base';
import { DevicesPanel } from './devices';
import { LeverPanel } from './levers';
import { FlightsPanel } from './flights';
import { OrganizationsPanel } from './organizations';
import { TimePanel } from './time';

/// `part` connect: the first set-up, step by step; flight: a new one.
export function System({ part }: { part: string | null }) {
  useEffect(() => {
    document.title = 'System - anchord';
  }, []);
  return (
    <div class="system" data-testid="system" tabIndex={0} role="region" aria-label="System">
      <h1 class="sr">System</h1>
      {part !== null && part !== 'connect' && part !== 'flight' && (
        <Unknown what="page" id={`#/system/${part}`} where="is in this dashboard">
          System is shown.
        </Unknown>
      )}
      {of_every_site.value && <DevicesPanel guided={part === 'connect'} />}
      <BasePanel />
      {of_every_site.value && <LeverPanel />}
      {of_every_site.value && <TimePanel />}
      <FlightsPanel beginning={part === 'flight'} />
      <HealthPanel />
      {of_every_site.value && may('admin') && <AccessPanel />}
      {of_every_site.value && may('admin') && <OrganizationsPanel />}
      {of_every_site.value && may('admin') && <AuditPanel />}
    </div>
  );
}

function HealthPanel() {
  const [list, set_list] = useState<readonly Check[] | null>(null),
    [built, set_built] = useState<Version | null>(null),
    value = system.value?.value;
  useEffect(() => {
    const look = (): void => {
      fetch_checks().then(set_list, () => set_list(null));
    };
    look();
    const timer = setInterval(look, 10_000);
    return () => clearInterval(timer);
  }, []);
  useLoad(() => void fetch_version().then(set_built, () => undefined));
  return (
    <section class="sys-p" data-testid="health">
      <div class="hd">
        <h2>Server</h2>
        <span class="meta">
          {built ? `anchord ${built.version}${built.git ? `, ${built.git.slice(0, 10)}` : ''}` : ''}
        </span>
      </div>
      <ul class="checks">
        {list?.map((c) => (
          <li key={c.name}>
            <Chip shape={c.ok ? 'ok' : 'bad'} tone={c.ok ? 'ok' : 'bad'} word={c.name.toUpperCase()} />
            {!c.ok && <span> {c.text}</span>}
          </li>
        ))}
      </ul>
      {!list && <NotLoaded />}
      {value && (
        <dl class="kv">
          <div>
            <dt>Free on disk</dt>
            <dd>{bytes(value.disk_free_bytes)}</dd>
          </div>
          <div>
            <dt>Database</dt>
            <dd>{bytes(value.db_bytes)}</dd>
          </div>
          <div>
            <dt>Rows waiting</dt>
            <dd>{grouped(value.queue_depth)}</dd>
          </div>
          <div>
            <dt>Dashboards</dt>
            <dd>{grouped(value.ws_clients)}</dd>
          </div>
          <div>
            <dt>Acknowledged rows survive</dt>
            <dd>{value.synchronous === 'full' || value.synchronous === 'extra' ? 'power loss' : 'a crash'}</dd>
          </div>
        </dl>
      )}
      {built && (
        <p class="sub">
          Schema {fixed(built.schema, 0)}, {built.build}. Metrics for Prometheus at{' '}
          <a class="link" href="metrics">
            /metrics
          </a>
          ; the interface is described at{' '}
          <a class="link" href="api/docs" data-testid="api-docs">
            /api/docs
          </a>
          , for programs at{' '}
          <a class="link" href="api/v1/openapi.json">
            /api/v1/openapi.json
          </a>
          .
        </p>
      )}
      {of_every_site.value && may('admin') && (
        <p class="sub">
          <a class="btn" href="api/v1/support-bundle" download="anchord-support.tar" data-testid="support-bundle">
            Download a support bundle
          </a>{' '}
          Versions, settings, log, metrics and what <code>anchord doctor</code> finds, in one archive. Passwords,
          tokens, keys, measurements and positions are left out.
        </p>
      )}
    </section>
  );
}
