// Alert rules and board name metrics that the server has, and promtool (Debian's prometheus) takes all of it.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { request } from 'node:http';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { promisify } from 'node:util';
import { Feeder, GatewayProcess } from './gateway.mjs';
import { startPostgres } from './postgres.mjs';
import { eventually, root, startServer } from './server.mjs';

const monitoring = join(root, 'docs/monitoring');
let server, metrics;
const promtool = (args, input) => {
  const running = promisify(execFile)('promtool', args);
  if (input !== undefined) running.child.stdin.end(input);
  return running;
};

before(async () => {
  server = await startServer({ args: ['--log-slow-ms', '100'] });
  const device = { kind: 'ntrip', address: 'tcp://127.0.0.1:1', options: { mount: 'M' } };
  assert.equal((await server.fetch('/api/v1/devices', { json: device })).status, 201);
  metrics = await (await server.fetch('/metrics')).text();
});
after(() => server?.dispose());

test('promtool finds nothing wrong with /metrics', async () => {
  const { stdout, stderr } = await promtool(['check', 'metrics'], metrics);
  assert.equal(stdout + stderr, '');
});

test('promtool takes the rules, and each fires when it should', async () => {
  const at = (name) => join(monitoring, 'prometheus', name);
  assert.match((await promtool(['check', 'rules', at('anchord.rules.yml')])).stdout, /SUCCESS: \d+ rules found/);
  assert.match((await promtool(['test', 'rules', at('anchord.rules.test.yml')])).stdout, /SUCCESS/);
  assert.match((await promtool(['check', 'config', at('prometheus.yml')])).stdout, /SUCCESS/);
  // That of the cluster, with what it names by containers' paths.
  const cluster = readFileSync(at('cluster.yml'), 'utf8').replace('/run/secrets/metrics.token', at('prometheus.yml'));
  const file = join(server.dataDir, 'cluster.yml');
  writeFileSync(file, cluster.replace('anchord.rules.yml', at('anchord.rules.yml')));
  assert.match((await promtool(['check', 'config', file])).stdout, /SUCCESS/);
});

/** What a gateway whose server is gone says of itself. */
async function gatewayMetrics() {
  const feeder = await new Feeder().start();
  const gateway = new GatewayProcess({ to: 'http://127.0.0.1:1', token: null, feeder });
  try {
    await gateway.start();
    return await (await fetch(`${gateway.url}/metrics`)).text();
  } finally {
    feeder.close();
    await gateway.dispose();
  }
}

/** What a server on PostgreSQL has besides: another one may wait for it. */
async function clusterMetrics() {
  const postgres = await startPostgres();
  try {
    await postgres.psql('CREATE DATABASE anchord');
    const holder = await startServer({ args: ['--database', postgres.url('anchord')], env: postgres.env });
    try {
      return await (await holder.fetch('/metrics')).text();
    } finally {
      await holder.dispose();
    }
  } finally {
    await postgres.dispose();
  }
}

test('every metric of the rules and the board is one of a server or a gateway', async () => {
  assert.equal((await server.fetch('/api/v1/backups', { method: 'POST', headers: { prefer: 'wait=10' } })).status, 201);
  const backedUp = await (await server.fetch('/metrics')).text();
  assert.match(backedUp, /^anchord_backup_failed 0$/m);
  assert.doesNotMatch(backedUp, /anchord_standby_waiting/);
  const [gateway, cluster] = [await gatewayMetrics(), await clusterMetrics()];
  assert.match(gateway, /^anchord_gateway_link_up 0$/m);
  assert.match(cluster, /^anchord_standby_waiting 0$/m);
  assert.doesNotMatch(cluster, /anchord_backup_failed/);
  for (const text of [backedUp, gateway, cluster]) {
    const { stdout, stderr } = await promtool(['check', 'metrics'], text);
    assert.equal(stdout + stderr, '');
  }
  const everything = backedUp + gateway + cluster;
  const served = new Set([...everything.matchAll(/^# TYPE (\S+) (\S+)/gm)].map((m) => m[1]));
  const named = (text) =>
    [...text.matchAll(/\banchord_[a-z0-9_]+/g)].map((m) => m[0].replace(/_(bucket|sum|count)$/, ''));
  const board = readFileSync(join(monitoring, 'grafana/anchord.json'), 'utf8');
  const all = [...named(board), ...named(readFileSync(join(monitoring, 'prometheus/anchord.rules.yml'), 'utf8'))];
  assert.ok(all.length > 30);
  assert.deepEqual(
    [...new Set(all)].filter((name) => !served.has(name)),
    [],
  );
});

test('each expression of the board is one that Prometheus can read', async () => {
  const { panels } = JSON.parse(readFileSync(join(monitoring, 'grafana/anchord.json'), 'utf8'));
  const rules = panels
    .flatMap((panel) => panel.targets)
    .map(({ expr }, i) => ({ record: `board:${i}`, expr: expr.replaceAll('$instance', '.*') }));
  const file = join(server.dataDir, 'board.rules.json');
  writeFileSync(file, JSON.stringify({ groups: [{ name: 'board', rules }] })); // JSON is YAML
  assert.match((await promtool(['check', 'rules', file])).stdout, new RegExp(`${rules.length} rules found`));
});

/** A POST whose body comes late: what the server measures begins with the head. */
const late = (id, headers = {}) =>
  new Promise((done, fail) => {
    const sending = request(
      `${server.url}/api/v1/sites`,
      { method: 'POST', headers: { 'content-type': 'application/json', 'x-request-id': id, ...headers } },
      (answer) => {
        answer.resume();
        answer.once('end', () => done(answer));
      },
    );
    sending.once('error', fail);
    sending.write('{"name":');
    setTimeout(() => sending.end(`"${id}"}`), 200);
  });

test('a slow request is a warning with the id that its client gave it, one that asked to wait is none', async () => {
  assert.equal((await late('waits-12345678', { prefer: 'wait=5' })).statusCode, 201);
  const answer = await late('slow-12345678');
  assert.equal(answer.statusCode, 201);
  assert.equal(answer.headers['x-request-id'], 'slow-12345678');
  const lines = () =>
    server.log
      .split('\n')
      .filter((line) => line.includes('slow request'))
      .map((line) => JSON.parse(line));
  const [line] = await eventually('the warning', () => lines().length > 0 && lines());
  assert.deepEqual(
    [line.request_id, line.method, line.route, line.status, line.level],
    ['slow-12345678', 'POST', '/api/v1/sites', '201', 'warning'],
  );
  assert.ok(Number(line.ms) >= 190, line.ms);
  assert.equal(lines().length, 1);
});
