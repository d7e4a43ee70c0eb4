#!/usr/bin/env python3
"""Our learners beside scikit-learn's and OpenCV's: the same rows, features, folds and settings; one table.

Needs python3-sklearn and python3-opencv, which the project itself does not. Run by hand:
    tests/bench/learners.py build/release/anchord ../shared/data
Accuracy and FPR (NLOS called LOS) are out of fold at 0.5 of one Platt line over all folds, as `anchord train`
reports them; seconds are those of the whole cross-validation on one thread (ours: of the command, reading included).
"""
import csv, gzip, io, json, os, subprocess, sys, tempfile, time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import numpy as np
from sklearn.ensemble import GradientBoostingClassifier, HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.svm import SVC

try:
    import cv2
    cv2.setNumThreads(1)
except ImportError:
    cv2 = None

BASE = ["range_m", "rx_dbm", "rx_minus_fp_db", "noise_excess_db", "fp_snr_db", "total_snr_db", "preamble_db"]
# name, file, columns naming a place, folds, features
SETS = [
    ("graz-rooms", "graz-rooms/rooms.csv.gz", "room_to", 10, BASE),
    ("ghent-iiot", "ghent-iiot/iiot19.csv.gz", "tag_pos", 10, BASE),
    ("warsaw-cir", "warsaw-cir/rangings.csv.gz", "setup", 23, ["fp_free_space_db", "rx_minus_fp_db", "range_m"]),
    ("bielefeld-mp", "bielefeld-mp/features.csv.gz", "", 3, ["range_m", "rx_dbm", "fp_dbm", "noise_excess_db", "fp_snr_db", "total_snr_db"]),
]
MASK = (1 << 64) - 1


def splitmix(seed):
    state = seed
    while True:
        state = (state + 0x9E3779B97F4A7C15) & MASK
        z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        yield z ^ (z >> 31)


def grouped_folds(group, k, seed=1):
    """As core/ml/dataset does it."""
    ids = sorted(set(group))
    size = {g: 0 for g in ids}
    for g in group:
        size[g] += 1
    draw = splitmix(seed)
    order = list(ids)
    for i in range(len(order), 1, -1):
        j = next(draw) % i
        order[i - 1], order[j] = order[j], order[i - 1]
    order.sort(key=lambda g: -size[g])
    k = max(1, min(k, len(order)))
    filled, fold_of = [0] * k, {}
    for g in order:
        lightest = filled.index(min(filled))
        filled[lightest] += size[g]
        fold_of[g] = lightest
    return np.array([fold_of[g] for g in group])


def numbered(names):
    ids = {}
    return np.array([ids.setdefault(n, len(ids)) for n in names])


def load(anchord, path, place, features):
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "set.csv")
        command = [anchord, "dataset", "build", "--data", path, "--aggregate", "none", "--out", out]
        if place:
            command += ["--group-by", place]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        rows = list(csv.DictReader(open(out, encoding="utf-8")))
    rows = [r for r in rows if r["los"] != "" and all(r.get(f) for f in features)]
    x = np.array([[float(r[f]) for f in features] for r in rows])
    return x, np.array([int(r["los"]) for r in rows]), numbered([r["environment"] for r in rows]), numbered([r["setting"] for r in rows])


def thinned(placement, rows, most=5):
    """At most five rows of a placement, evenly spread, and their weights."""
    by = {}
    for i in rows:
        by.setdefault(placement[i], []).append(i)
    taken, weight = [], []
    for members in by.values():
        n = min(most, len(members))
        taken += [members[(2 * j + 1) * len(members) // (2 * n)] for j in range(n)]
        weight += [1.0 / n] * n
    return np.array(taken), np.array(weight)


def platt(score, y, w):
    a, b = 1.0, 0.0
    for _ in range(100):
        p = 1 / (1 + np.exp(-np.clip(a * score + b, -40, 40)))
        h = w * np.maximum(p * (1 - p), 1e-9)
        g = np.array([np.sum(w * (p - y) * score), np.sum(w * (p - y))])
        m = np.array([[np.sum(h * score * score) + 1e-9, np.sum(h * score)], [np.sum(h * score), np.sum(h) + 1e-9]])
        step = np.linalg.solve(m, g)
        a, b = a - step[0], b - step[1]
        if np.abs(step).max() < 1e-10:
            break
    return a, b


def logit(p):
    p = np.clip(p, 1e-3, 1 - 1e-3)
    return np.log(p / (1 - p))


class OpenCv:
    """OpenCV's learners behind fit and a score."""

    def __init__(self, kind, n):
        self.kind = kind
        if kind == "forest":
            self.model = cv2.ml.RTrees_create()
            self.model.setMaxDepth(25)
            self.model.setMinSampleCount(max(2, int(0.06 * n)))
            self.model.setTermCriteria((cv2.TERM_CRITERIA_MAX_ITER, 120, 0))
        elif kind == "svm":
            self.model = cv2.ml.SVM_create()
            self.model.setType(cv2.ml.SVM_C_SVC)
            self.model.setKernel(cv2.ml.SVM_RBF)
            self.model.setGamma(0.03)
        else:
            self.model = cv2.ml.Boost_create()
            self.model.setBoostType(cv2.ml.BOOST_REAL)
            self.model.setWeakCount(150)
            self.model.setMaxDepth(3)

    def fit(self, x, y, w):
        if self.kind == "svm":
            self.model.setC(3 * float(w.mean()))
            self.model.setTermCriteria((cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100000, 1e-3))
        var_type = np.array([cv2.ml.VAR_ORDERED] * x.shape[1] + [cv2.ml.VAR_CATEGORICAL], np.uint8)
        data = cv2.ml.TrainData_create(x.astype(np.float32), cv2.ml.ROW_SAMPLE, y.astype(np.int32), varType=var_type)
        self.model.train(data)
        return self

    def score(self, x):
        x = x.astype(np.float32)
        if self.kind == "forest":
            votes = self.model.getVotes(x, 0)[1:]
            order = list(self.model.getVotes(x, 0)[0])
            return logit(votes[:, order.index(1)] / votes.sum(axis=1))
        raw = self.model.predict(x, flags=cv2.ml.STAT_MODEL_RAW_OUTPUT)[1][:, 0]
        return -raw if self.kind == "svm" else raw


def peers(kind, n, c):
    many = n > 5000
    if kind == "logistic":
        return {"scikit-learn": lambda: LogisticRegression(C=c, max_iter=1000)}
    if kind == "forest":
        leaf = max(1, int(0.03 * n))
        out = {"scikit-learn": lambda: RandomForestClassifier(120, min_samples_leaf=leaf, max_features="sqrt", random_state=1, n_jobs=1)}
    elif kind == "svm":
        out = {"scikit-learn": lambda: SVC(C=3, gamma=0.03)}
    else:
        out = {"scikit-learn": lambda: HistGradientBoostingClassifier(max_iter=600 if many else 150, max_depth=6 if many else 3, learning_rate=0.05, l2_regularization=2, min_samples_leaf=5, early_stopping=False, random_state=1),
               "scikit-learn exact": lambda: GradientBoostingClassifier(n_estimators=150, max_depth=3, learning_rate=0.05, max_features=0.4, random_state=1)}
    if cv2 is not None:
        out["OpenCV"] = lambda: OpenCv(kind, n)
    return out


def fit_score(model, x, y, w, other):
    if isinstance(model, OpenCv):
        return model.fit(x, y, w).score(other)
    model.fit(x, y, sample_weight=w)
    if hasattr(model, "decision_function"):
        return model.decision_function(other)
    return logit(model.predict_proba(other)[:, 1])


def judge(x, y, group, placement, folds, make, cap):
    fold = grouped_folds(list(group), folds)
    score, start = np.zeros(len(y)), time.time()
    for k in range(fold.max() + 1):
        inside, outside = np.where(fold == k)[0], np.where(fold != k)[0]
        rows, w = thinned(placement, outside)
        if cap and len(rows) > cap:
            pick = (2 * np.arange(cap) + 1) * len(rows) // (2 * cap)
            rows, w = rows[pick], w[pick]
        mean = np.average(x[rows], axis=0, weights=w)
        sd = np.sqrt(np.average((x[rows] - mean) ** 2, axis=0, weights=w))
        z = np.clip((x - mean) / np.where(sd > 0, sd, 1), -3, 3)
        score[inside] = fit_score(make(len(rows)), z[rows], y[rows], w, z[inside])
    seconds = time.time() - start
    weight = np.array([1.0 / n for n in np.bincount(placement)])[placement]
    a, b = platt(score, y, weight)
    los = a * score + b >= 0
    return (los == (y == 1)).mean(), los[y == 0].mean(), seconds


def ours(anchord, path, place, folds, features, method, engine="own"):
    with tempfile.TemporaryDirectory() as folder:
        command = [anchord, "train", "--data", path, "--method", method, "--engine", engine, "--features", ",".join(features), "--folds", str(folds), "--threads", "1", "--out", os.path.join(folder, "m.json"), "--json"]
        if place:
            command += ["--group-by", place]
        start = time.time()
        out = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    row = out["candidates"][0]
    return row["accuracy"], row["fpr"], time.time() - start


def main():
    anchord, data = sys.argv[1], sys.argv[2]
    print("| set | learner | library | accuracy | FPR | seconds |\n|---|---|---|---|---|---|")
    for name, file, place, folds, features in SETS:
        path = os.path.join(data, file)
        x, y, group, placement = load(anchord, path, place, features)
        few = placement.max() + 1 < 40
        for kind, method, cap in [("logistic", "logistic", 0), ("forest", "random_forest", 0), ("svm", "svm", 4000), ("boosted", "boosted", 0)]:
            results = [("anchord", ours(anchord, path, place, folds, features, method))]
            if kind in ("forest", "svm"):
                results.append(("anchord, engine opencv", ours(anchord, path, place, folds, features, method, "opencv")))
            n = len(thinned(placement, range(len(y)))[0])
            for library, make in peers(kind, n, 0.3 if few else 3).items():
                results.append((library, judge(x, y, group, placement, folds, lambda rows, make=make: make(), cap)))
            for library, (accuracy, fpr, seconds) in results:
                print(f"| {name} | {kind} | {library} | {accuracy:.3f} | {fpr:.3f} | {seconds:.1f} |", flush=True)


main()
