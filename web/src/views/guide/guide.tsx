/// The guide, as pages of the product: set up, fly, what each screen means, what to do when something is missing.
import { useEffect } from 'preact/hooks';
import './guide.css';
import { Unknown } from '../../ui/unknown';
import { page_for, page_of, PAGES, type Block, type Page } from './pages';

/// `Heading`: one below that of the page.
const Blocks = ({ blocks, Heading }: { blocks: readonly Block[]; Heading: 'h2' | 'h4' }) => (
  <>
    {blocks.map((b, i) =>
      'p' in b ? (
        <p key={i}>{b.p}</p>
      ) : 'h' in b ? (
        <Heading key={i}>{b.h}</Heading>
      ) : 'steps' in b ? (
        <ol key={i}>
          {b.steps.map((s) => (
            <li key={s}>{s}</li>
          ))}
        </ol>
      ) : 'list' in b ? (
        <ul key={i}>
          {b.list.map((s) => (
            <li key={s}>{s}</li>
          ))}
        </ul>
      ) : (
        <div key={i} class="scrollx" tabIndex={0} role="region" aria-label={b.head[0]}>
          <table class="tbl">
            <thead>
              <tr>
                {b.head.map((h) => (
                  <th key={h} scope="col">
                    {h}
                  </th>
                ))}
              </tr>
            </thead>
            <tbody>
              {b.rows.map((r) => (
                <tr key={r[0]}>
                  <th scope="row">{r[0]}</th>
                  {r.slice(1).map((c) => (
                    <td key={c}>{c}</td>
                  ))}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      ),
    )}
  </>
);

export function Guide({ page: id }: { page: string | null }) {
  const page = page_of(id),
    groups = [...new Set(PAGES.map((p) => p.group))];
  useEffect(() => {
    document.title = `${page.title} - anchord guide`;
  }, [page]);
  return (
    <div class="guide" data-testid="guide">
      <nav class="guidenav" aria-label="Pages of the guide">
        {groups.map((g) => (
          <div key={g}>
            <h2>{g}</h2>
            <ul>
              {PAGES.filter((p) => p.group === g).map((p) => (
                <li key={p.id}>
                  <a href={`#/guide/${p.id}`} aria-current={p === page ? 'page' : undefined}>
                    {p.title}
                  </a>
                </li>
              ))}
            </ul>
          </div>
        ))}
      </nav>
      <article class="guidepage" tabIndex={0} aria-label={page.title}>
        {id !== null && page.id !== id && (
          <Unknown what="page" id={`#/guide/${id}`} where="is in the guide">
            its first page is shown.
          </Unknown>
        )}
        <h1>{page.title}</h1>
        <Blocks blocks={page.blocks} Heading="h2" />
      </article>
    </div>
  );
}

/// In the help sheet: the page for what is on the screen, by its name or by the address of a view.
export function GuideSheet({ page: named, close }: { page: string; close: () => void }) {
  const page: Page = page_of(page_for(named));
  return (
    <div class="guidepage insheet" data-testid="help-page">
      <h3>{page.title}</h3>
      <Blocks blocks={page.blocks} Heading="h4" />
      <p>
        <a class="btn small" href={`#/guide/${page.id}`} onClick={close}>
          All pages of the guide
        </a>
      </p>
    </div>
  );
}
