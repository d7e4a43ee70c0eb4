#pragma once

namespace anchord {

class AccessStore;
class AnchorStore;
class BundleStore;
class CalibrationStore;
class CampaignStore;
class DatasetStore;
class EventStore;
class ExclusionStore;
class FrameStore;
class JobStore;
class KitStore;
class LabelStore;
class MeasurementStore;
class MissionBin;
class MissionStore;
class ModelStore;
class OrganizationStore;
class PlaceStore;
class PlanStore;
class ProcedureLog;
class RevisionStore;
class ServiceStore;
class SiteStore;
class TokenStore;
class TrainingRunStore;
class WebhookStore;

/// Everything that is kept, by port; whoever opened the database owns them and outlives their users.
struct Stores {
  MeasurementStore& measurements;
  MissionStore& missions;
  MissionBin& bin;
  ExclusionStore& exclusions;
  EventStore& events;
  ProcedureLog& procedure_log;
  SiteStore& sites;
  AnchorStore& anchors;
  CalibrationStore& calibrations;
  RevisionStore& revisions;
  KitStore& kits;
  FrameStore& frames;
  PlanStore& plans;
  CampaignStore& campaigns;
  LabelStore& labels;
  DatasetStore& datasets;
  TrainingRunStore& training_runs;
  ModelStore& models;
  JobStore& jobs;
  TokenStore& tokens;
  AccessStore& access;
  ServiceStore& service;
  WebhookStore& webhooks;
  PlaceStore& places;
  BundleStore& bundles;
  OrganizationStore& organizations;
};

}  // namespace anchord
