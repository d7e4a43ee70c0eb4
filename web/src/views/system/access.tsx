/// Who may use this server, and what was done on it: tokens with one role each, and the audit log.
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import {
  audit as fetch_audit,
  create_token,
  revoke_token,
  ROLES,
  type Role,
  tokens as fetch_tokens,
  type AuditLine,
  type Token,
} from '../../api/system';
import { organizations, read_organizations } from '../../state/organizations';
import { say } from '../../state/store';
import { Empty, useLoad } from '../../ui/empty';
import { CopyBox } from '../../ui/copy_box';
import { date, grouped } from '../../ui/format';
import { Problem } from '../../ui/problem';

const ROLE_WORDS: Record<string, string> = {
  viewer: 'sees everything',
  integrator: 'for facility tools: reads and annotates anchors',
  gateway: 'sends measurements only',
  engineer: 'trains and publishes',
  operator: 'flies',
  admin: 'everything',
};

export function AccessPanel() {
  const [all, set_all] = useState<readonly Token[] | null>(null),
    [problem, set_problem] = useState(''),
    [name, set_name] = useState(''),
    [role, set_role] = useState<Role>('viewer'),
    [firm, set_firm] = useState(''),
    [secret, set_secret] = useState(''),
    [sure, set_sure] = useState('');
  const load = (): void => {
    fetch_tokens().then(
      (list) => {
        set_all(list);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  };
  useLoad(load);
  useLoad(() => void read_organizations().catch(() => undefined));
  const guarded = async (work: () => Promise<void>): Promise<void> => {
    set_problem('');
    try {
      await work();
      load();
    } catch (e) {
      set_problem(error_text(e));
    }
  };
  const create = (): void =>
    void guarded(async () => {
      set_secret(await create_token(name.trim(), role, firm || null));
      set_name('');
      set_firm('');
    });
  /// Two presses: a revoked token cannot be brought back.
  const revoke = (t: Token): void => {
    if (sure !== t.id) set_sure(t.id);
    else
      void guarded(async () => {
        await revoke_token(t.id);
        set_sure('');
        say(`${t.name} revoked`);
      });
  };
  const valid = (all ?? []).filter((t) => !t.revoked_at);
  return (
    <section class="sys-p" data-testid="access">
      <h2>Access</h2>
      <Problem text={problem} />
      <form
        class="callout addform"
        onSubmit={(e) => {
          e.preventDefault();
          create();
        }}
      >
        <label class="grow">
          <span class="lab">Name</span>
          <input
            required
            maxLength={100}
            value={name}
            placeholder="who or what will use it"
            onInput={(e) => set_name(e.currentTarget.value)}
          />
        </label>
        <label>
          <span class="lab">Role</span>
          <select value={role} onChange={(e) => set_role(e.currentTarget.value as Role)}>
            {ROLES.map((r) => (
              <option key={r} value={r}>
                {r}: {ROLE_WORDS[r]}
              </option>
            ))}
          </select>
        </label>
        <label>
          <span class="lab">Sites</span>
          <select value={firm} data-testid="token-organization" onChange={(e) => set_firm(e.currentTarget.value)}>
            <option value="">every site</option>
            {(organizations.value ?? []).map((o) => (
              <option key={o.id} value={o.id}>
                those of {o.name}
              </option>
            ))}
          </select>
        </label>
        <span class="actions">
          <button class="btn primary" data-testid="create-token" disabled={!name.trim()}>
            Make a token
          </button>
        </span>
      </form>
      {secret && (
        <div class="callout caution" data-testid="secret">
          <b>Copy it now: it is shown only once.</b>
          <CopyBox label="Copy the token" text={secret} />
          <button class="btn small" onClick={() => set_secret('')}>
            I have it
          </button>
        </div>
      )}
      <table class="tbl">
        <caption class="sr">Tokens that are valid</caption>
        <thead>
          <tr>
            <th scope="col">Token</th>
            <th scope="col">Role</th>
            <th scope="col">Sites</th>
            <th scope="col">Last used</th>
            <th scope="col">Ends</th>
            <th scope="col">
              <span class="sr">Revoke</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {valid.map((t) => (
            <tr key={t.id}>
              <th scope="row">
                {t.name}
                <span class="mut block">made {date(t.created_at)}</span>
              </th>
              <td>{t.roles.join(', ')}</td>
              <td>
                {t.sites ? grouped(t.sites.length) : <span class="mut">every site</span>}
                {t.organization && (
                  <span class="mut block">
                    of {organizations.value?.find((o) => o.id === t.organization)?.name ?? 'an organization'}
                  </span>
                )}
              </td>
              <td>{t.last_used_at ? date(t.last_used_at) : <span class="mut">never</span>}</td>
              <td>{t.expires_at ? date(t.expires_at) : <span class="mut">never</span>}</td>
              <td class="acts">
                <button class="btn small" onClick={() => revoke(t)}>
                  {sure === t.id ? 'Press again to revoke' : 'Revoke'}
                </button>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
      {valid.length === 0 && (
        <Empty loaded={all !== null} failed={problem !== ''}>
          There is no valid token: only this computer, without sign-in, can use the server.
        </Empty>
      )}
    </section>
  );
}

export function AuditPanel() {
  const [lines, set_lines] = useState<readonly AuditLine[] | null>(null),
    [problem, set_problem] = useState('');
  useLoad(() => {
    fetch_audit().then(
      (list) => {
        set_lines(list);
        set_problem('');
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  });
  return (
    <section class="sys-p" data-testid="audit">
      <h2>Audit log</h2>
      {problem && (
        <div class="problem" role="status">
          {problem}
        </div>
      )}
      <div class="auditbox" tabIndex={0} role="region" aria-label="Audit log">
        <table class="tbl">
          <caption class="sr">What was done, newest first</caption>
          <thead>
            <tr>
              <th scope="col">When, UTC</th>
              <th scope="col">Who</th>
              <th scope="col">What</th>
              <th scope="col">Result</th>
            </tr>
          </thead>
          <tbody>
            {lines?.map((l, i) => (
              <tr key={`${l.at}${i}`}>
                <th scope="row" class="whole">
                  {l.at.slice(0, 19).replace('T', ' ')}
                </th>
                <td>{l.who}</td>
                <td class="wrap">{l.what}</td>
                <td>{l.result}</td>
              </tr>
            ))}
          </tbody>
        </table>
        {!lines?.length && (
          <Empty loaded={lines !== null} failed={problem !== ''}>
            Nothing has been changed yet.
          </Empty>
        )}
      </div>
    </section>
  );
}
