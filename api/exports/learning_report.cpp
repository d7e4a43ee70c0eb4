#include "api/exports/learning_report.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace anchord::api {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const ml::Confusion& c) { return {{"tp", c.tp}, {"fp", c.fp}, {"fn", c.fn}, {"tn", c.tn}}; }

Json json_of(const ml::BiasEvaluation& b) {
  return {{"n", b.raw.n},
          {"mae_raw_m", b.raw.mae_m},
          {"mae_m", b.corrected.mae_m},
          {"mse_raw_m2", b.raw.mse_m2},
          {"mse_m2", b.corrected.mse_m2},
          {"mae_improvement", ml::improvement(b.raw.mae_m, b.corrected.mae_m)},
          {"mse_improvement", ml::improvement(b.raw.mse_m2, b.corrected.mse_m2)}};
}

Json json_of(const RowReport& r) {
  Json dropped = Json::array();
  for (const auto& [reason, entry] : r.dropped) {
    Json item{{"reason", reason}, {"count", entry.first}};
    if (!entry.second.empty()) item["first"] = entry.second;
    dropped.push_back(item);
  }
  Json out{{"files", r.files}, {"rows_read", r.read}, {"rows_used", r.used}, {"dropped", dropped}};
  const auto text = [](const std::string& s) { return s.empty() ? Json(nullptr) : Json(s); };
  out["columns"] = {{"label", text(r.label)},
                    {"truth", text(r.truth)},
                    {"group_by", text(r.group_by)},
                    {"placement", text(r.placement)}};
  if (!r.warning.empty()) out["warning"] = r.warning;
  return out;
}

void put_confusion(Json& out, const ml::Confusion& c) {
  out["accuracy"] = c.accuracy();
  out["balanced_accuracy"] = c.balanced_accuracy();
  out["fpr"] = c.fpr();
  out["fnr"] = c.fnr();
  out["confusion"] = json_of(c);
}

std::string format(const char* pattern, auto... values) {
  std::array<char, 512> text{};
  std::snprintf(text.data(), text.size(), pattern, values...);
  return text.data();
}

std::string text_of(const RowReport& r) {
  std::string out = format("rows: %zu read, %zu used", r.read, r.used);
  for (const auto& [reason, entry] : r.dropped)
    out += format("\n  dropped %zu: %s%s%s", entry.first, reason.c_str(),
                  entry.second.empty() ? "" : ", first ", entry.second.c_str());
  if (!r.group_by.empty()) out += "\nplaces by: " + r.group_by;
  if (!r.warning.empty()) out += "\nwarning: " + r.warning;
  return out + "\n";
}

std::string text_row(const char* name, const ml::BiasEvaluation& b) {
  return format("  %-6s %7zu  raw %.3f m  corrected %.3f m  (%+.1f %%)   MSE %.4f -> %.4f m2\n", name,
                b.raw.n, b.raw.mae_m, b.corrected.mae_m,
                100 * ml::improvement(b.raw.mae_m, b.corrected.mae_m), b.raw.mse_m2, b.corrected.mse_m2);
}

}  // namespace

std::string train_json(const ml::Learned& learned, const RowReport& rows, const std::string& out_path) {
  const auto& info = learned.model.info;
  Json out{{"model", out_path},          {"task", ml::task_name(info.task)},
           {"method", info.method},      {"why", info.why},
           {"features", info.features},  {"data", json_of(rows)},
           {"digest", info.data_digest}, {"placements", info.placements},
           {"places", info.groups},      {"folds", info.folds},
           {"seed", info.seed}};
  Json cv = Json::object();
  for (const auto& [name, value] : info.metrics) cv[name] = value;
  out["cross_validation"] = cv;
  const bool bias = info.task != ml::Task::nlos_id;
  Json table = Json::array();
  for (const auto& row : learned.table) {
    Json entry{{"candidate", row.name}, {"picked", row.picked}};
    if (bias) {
      entry["mae_m"] = row.error.mae_m;
      entry["mse_m2"] = row.error.mse_m2;
      entry["worst_place_harm_m"] = row.worst_harm_m;
      entry["mae_improvement"] = ml::improvement(learned.table.front().error.mae_m, row.error.mae_m);
    } else {
      put_confusion(entry, row.confusion);
      entry["brier"] = row.brier;
      entry["log_loss"] = row.loss;
      entry["log_loss_sd"] = row.loss_sd;
    }
    table.push_back(entry);
  }
  out["candidates"] = table;
  if (learned.model.classifier) out["threshold"] = learned.model.classifier->threshold;
  return out.dump(2) + "\n";
}

std::string train_text(const ml::Learned& learned, const RowReport& rows, const std::string& out_path) {
  const auto& info = learned.model.info;
  std::string out = text_of(rows);
  out += format("%zu placements in %zu places, %zu folds of whole places, seed %llu\n\n", info.placements,
                info.groups, info.folds, static_cast<unsigned long long>(info.seed));
  const bool bias = info.task != ml::Task::nlos_id;
  out += bias ? format("   %-52s %8s %9s %12s\n", "on held-out places", "MAE m", "MSE m2", "worst harm m")
              : format("   %-52s %8s %7s %7s %9s %7s\n", "on held-out places", "accuracy", "FPR", "FNR",
                       "log loss", "Brier");
  for (const auto& row : learned.table) {
    out += bias ? format(" %s %-52s %8.3f %9.4f %+12.3f\n", row.picked ? "*" : " ", row.name.c_str(),
                         row.error.mae_m, row.error.mse_m2, row.worst_harm_m)
                : format(" %s %-52s %8.3f %7.3f %7.3f %9.3f %7.3f\n", row.picked ? "*" : " ",
                         row.name.c_str(), row.confusion.accuracy(), row.confusion.fpr(), row.confusion.fnr(),
                         row.loss, row.brier);
  }
  out += "\npicked: " + info.why + "\nmodel: " + out_path + "\n";
  return out;
}

std::string evaluation_json(const ml::Evaluation& e, const ml::Model& model, const RowReport& rows) {
  Json out{{"task", ml::task_name(model.info.task)}, {"method", model.info.method}, {"n", e.rows}};
  if (e.confusion) {
    put_confusion(out, *e.confusion);
    out["threshold"] = model.classifier->threshold;
    out["brier"] = e.brier;
    out["log_loss"] = e.log_loss;
    out["roc_auc"] = e.roc_auc;
  }
  if (e.all) {
    out["mae_raw_m"] = e.all->raw.mae_m;
    out["mae_m"] = e.all->corrected.mae_m;
    out["mse_raw_m2"] = e.all->raw.mse_m2;
    out["mse_m2"] = e.all->corrected.mse_m2;
    out["bias"] = {{"all", json_of(*e.all)}};
    if (e.los) out["bias"]["los"] = json_of(*e.los);
    if (e.nlos) out["bias"]["nlos"] = json_of(*e.nlos);
    if (e.nll) out["mean_negative_log_likelihood"] = *e.nll;
    Json cdf = Json::array();
    for (std::size_t i = 0; i < e.cdf_raw.size(); i += 5)
      cdf.push_back({{"share", e.cdf_raw[i].share},
                     {"raw_m", e.cdf_raw[i].value_m},
                     {"corrected_m", e.cdf_corrected[i].value_m}});
    out["cdf"] = cdf;
  }
  if (!e.roc.empty()) {
    Json roc = Json::array();
    const std::size_t step = std::max<std::size_t>(1, e.roc.size() / 100);
    for (std::size_t i = 0; i < e.roc.size(); ++i)
      if (i % step == 0 || i + 1 == e.roc.size())
        roc.push_back({{"threshold", e.roc[i].threshold}, {"fpr", e.roc[i].fpr}, {"tpr", e.roc[i].tpr}});
    out["roc"] = roc;
  }
  Json places = Json::array();
  for (const auto& place : e.places) {
    Json entry{{"place", place.place}, {"n", place.rows}};
    if (place.accuracy) entry["accuracy"] = *place.accuracy;
    if (place.bias) entry["mae_raw_m"] = place.bias->raw.mae_m, entry["mae_m"] = place.bias->corrected.mae_m;
    places.push_back(entry);
  }
  out["places"] = places;
  out["data"] = json_of(rows);
  return out.dump(2) + "\n";
}

std::string evaluation_text(const ml::Evaluation& e, const ml::Model& model, const RowReport& rows) {
  std::string out = text_of(rows);
  out += "model: " + std::string{ml::task_name(model.info.task)} + ", " + model.info.method + "\n";
  if (e.confusion) {
    const auto& c = *e.confusion;
    out += format(
        "accuracy %.4f   balanced %.4f   FPR (NLOS called LOS) %.4f   FNR %.4f   Brier %.4f   ROC area "
        "%.4f\n",
        c.accuracy(), c.balanced_accuracy(), c.fpr(), c.fnr(), e.brier, e.roc_auc);
    out += format("  LOS: %.0f right, %.0f called NLOS;  NLOS: %.0f right, %.0f called LOS\n", c.tp, c.fn,
                  c.tn, c.fp);
  }
  if (e.all) {
    out += "range bias (mean absolute error; raw is no correction)\n" + text_row("all", *e.all);
    if (e.los) out += text_row("LOS", *e.los);
    if (e.nlos) out += text_row("NLOS", *e.nlos);
    if (e.nll) out += format("  mean negative log-likelihood %.3f\n", *e.nll);
  }
  return out;
}

}  // namespace anchord::api
