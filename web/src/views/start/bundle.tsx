/// A bundle of another server: taken as it is, and what came of it.
import { useEffect, useState } from 'preact/hooks';
import { import_bundle, type Imported } from '../../api/bundles';
import { error_text } from '../../api/client';
import { came_of, type Came } from './came_of';

export function Bundle({ file, back }: { file: File; back: () => void }) {
  const [problem, set_problem] = useState(''),
    [came, set_came] = useState<Came | null>(null);
  useEffect(() => {
    let gone = false;
    import_bundle(file).then(
      (answer: Imported) => !gone && set_came(came_of(answer)),
      (e: unknown) => !gone && set_problem(error_text(e)),
    );
    return () => {
      gone = true;
    };
  }, [file]);
  return (
    <section class="sec-p" data-testid="bundle-import">
      <h2>{file.name}</h2>
      {!came && !problem && <p role="status">The server checks and stores it. A large one takes minutes.</p>}
      {problem && (
        <div class="problem" role="alert" data-testid="bundle-problem">
          <b>It was not imported.</b> {problem}
        </div>
      )}
      {came && (
        <>
          <p role="status" data-testid="bundle-result">
            {came.words}
          </p>
          <ul>
            {came.flights.map((f) => (
              <li key={f.mission}>
                <a class="btn small" href={`#/replay/${f.mission}`}>
                  {f.name}
                </a>{' '}
                <span class="mut">{f.already ? 'was already on this server' : 'imported'}</span>
              </li>
            ))}
          </ul>
          {came.left_out.length > 0 && (
            <details open>
              <summary>{came.left_out.length} not imported, with the reason</summary>
              <ul>
                {came.left_out.map((one) => (
                  <li key={`${one.what} ${one.why}`}>
                    {one.what}: {one.why}
                  </li>
                ))}
              </ul>
            </details>
          )}
        </>
      )}
      <button class="btn" onClick={back}>
        Another file
      </button>
    </section>
  );
}
