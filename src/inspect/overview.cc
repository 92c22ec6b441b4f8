#include "inspect/overview.h"

#include <algorithm>
#include <map>
#include <thread>
#include <vector>

#include <unistd.h>

#include "base/clock.h"
#include "base/utf8.h"
#include "calls/server_core.h"
#include "component/component_core.h"
#include "component/peers.h"
#include "component/service_topics.h"
#include "component/words.h"
#include "host/callbacks.h"
#include "host/unmatched.h"
#include "inspect/process_usage.h"
#include "inspect/voice.h"
#include "record/descriptor_set.h"

namespace fastcycle::inspect {
namespace {

void fill(const base::HistogramSummary& summary, protocol::Histogram& said) {
  said.set_count(summary.count);
  said.set_mean_ns(summary.mean);
  said.set_sd_ns(summary.standard_deviation);
  said.set_p50_ns(summary.p50);
  said.set_p99_ns(summary.p99);
  said.set_p999_ns(summary.p999);
  said.set_max_ns(summary.max);
}

void fill(const base::HistogramSummary& summary, const base::HistogramBuckets& buckets,
          protocol::Histogram& said) {
  fill(summary, said);
  // A sample recorded between the two is in the buckets only: these are to be consistent.
  said.set_count(buckets.count);
  said.set_mean_ns(buckets.count == 0 ? 0.0 : buckets.sum_ns / static_cast<double>(buckets.count));
  for (std::size_t i = 0; i < buckets.below.size(); ++i) {
    protocol::Histogram::Bucket& bucket = *said.add_buckets();
    bucket.set_bound_ns(base::HistogramBuckets::bound_ns(i));
    bucket.set_count(buckets.below[i]);
  }
}

template <unsigned kSubBits>
void fill(const base::LogHistogram<kSubBits>& histogram, bool with_buckets,
          protocol::Histogram& said) {
  if (with_buckets) {
    fill(histogram.summary(), histogram.buckets(), said);
  } else {
    fill(histogram.summary(), said);
  }
}

/// The same, of a component in another process, which may have sent no buckets.
void fill(const base::HistogramSummary& summary, const base::HistogramBuckets& buckets,
          bool with_buckets, protocol::Histogram& said) {
  said.Clear();
  if (with_buckets && buckets.count >= summary.count) {
    fill(summary, buckets, said);
  } else {
    fill(summary, said);
  }
}

void fill(const detail::Ledger& ledger, protocol::Ledger& said) {
  said.set_published(ledger.published);
  said.set_delivered(ledger.delivered);
  said.set_queued(ledger.queued);
  said.set_dropped(ledger.dropped_total());
  for (std::size_t i = 0; i < ledger.dropped.size(); ++i) {
    if (ledger.dropped[i] > 0) {
      protocol::Drop& drop = *said.add_drops();
      drop.set_reason(detail::to_word(static_cast<detail::DropReason>(i)));
      drop.set_count(ledger.dropped[i]);
    }
  }
}

void fill(const ProcessUsage& usage, google::protobuf::RepeatedPtrField<protocol::Thread>& said) {
  for (const auto& [name, threads] : usage.threads) {
    protocol::Thread& one = *said.Add();
    one.set_name(name);
    one.set_cpu_ns(threads.cpu_ns);
    one.set_count(threads.count);
  }
}

void fill_processes(const std::vector<host::Peers::Process>& others, protocol::Overview& overview) {
  for (const host::Peers::Process& other : others) {
    const auto usage = process_usage(static_cast<pid_t>(other.pid));
    if (!usage || usage->parent != ::getppid()) {
      continue;  // It has ended; another program may have its pid already.
    }
    protocol::Process& said = *overview.add_processes();
    said.set_name(other.name);
    said.set_pid(other.pid);
    said.set_cpu_ns(usage->cpu_ns);
    said.set_rss_kib(usage->resident_bytes / 1024);
    said.set_virtual_kib(usage->virtual_bytes / 1024);
    said.set_open_files(usage->open_files);
    said.set_start_ns(usage->start_ns);
    fill(*usage, *said.mutable_threads());
  }
}

/// Adds `subscriber` to the counts of its topic.
void count_in(const protocol::Subscriber& subscriber, protocol::Topic& topic) {
  topic.set_dropped(topic.dropped() + subscriber.ledger().dropped());
  if (subscriber.latency().count() > 0 &&
      (!topic.has_latency() || subscriber.latency().p99_ns() > topic.latency().p99_ns())) {
    *topic.mutable_latency() = subscriber.latency();
  }
}

}  // namespace

std::vector<KnownService> find_services(const host::Application& application) {
  std::vector<KnownService> services;
  for (const auto& component : application.components()) {
    for (const auto& end : component->servers) {
      const auto& server = detail::ServerCore::of(*end);
      services.push_back({.name = server.service,
                          .component = component->name,
                          .request = server.request_instance,
                          .reply = server.reply_instance,
                          .feedback = server.feedback_instance,
                          .clients = {}});
    }
  }
  for (KnownService& service : services) {
    for (const auto& component : application.components()) {
      for (const auto& client : component->clients) {
        if (client->service == service.name) {
          service.clients.push_back(component->name);
        }
      }
    }
  }
  std::ranges::sort(services, {}, &KnownService::name);
  return services;
}

void fill_application(const host::Application& application, protocol::Overview& overview) {
  const config::ApplicationDescription& description = application.description();
  overview.set_file(description.file.string());
  overview.set_clock(application.clock().is_simulated() ? "simulated" : "live");
  overview.set_now_ns(base::to_ns(application.clock().now()));
  overview.set_start_ns(base::to_ns(application.start_time()));
  overview.set_monotonic_ns(base::monotonic_ns());
  overview.set_mode(application.modes().current());
  for (const config::ModeDescription& mode : description.modes) {
    overview.add_modes(mode.name);
  }
  overview.set_end(host::to_word(application.end_reason()));
  const ProcessUsage usage = process_usage();
  overview.set_cpu_ns(usage.cpu_ns);
  overview.set_rss_kib(usage.resident_bytes / 1024);
  overview.set_virtual_kib(usage.virtual_bytes / 1024);
  overview.set_open_files(usage.open_files);
  overview.set_max_files(usage.max_files);
  overview.set_process_start_ns(usage.start_ns);
  fill(usage, *overview.mutable_threads());
  if (application.peers() != nullptr) {
    fill_processes(application.peers()->others(), overview);
  }
  overview.set_cpus(std::max(1U, std::thread::hardware_concurrency()));
}

void fill_executors(const host::Application& application, protocol::Overview& overview) {
  const auto add = [&](const config::ExecutorDescription& executor) {
    protocol::Executor& said = *overview.add_executors();
    said.set_name(executor.name);
    said.set_threads(static_cast<std::uint32_t>(executor.threads));
    said.mutable_cpus()->Add(executor.cpus.begin(), executor.cpus.end());
    said.set_policy(std::string(config::to_string(executor.policy)));
    said.set_priority(executor.priority);
    said.set_wait(std::string(config::to_string(executor.wait)));
  };
  const auto& described = application.description().executors;
  std::ranges::for_each(described, add);
  // Of all components that name none.
  for (std::size_t i = described.size(); i < application.executor_names().size(); ++i) {
    config::ExecutorDescription pool;
    pool.name = application.executor_names()[i];
    pool.threads = i < application.executors().size()
                       ? static_cast<int>(application.executors()[i]->options().threads)
                       : 1;
    add(pool);
  }
}

void fill_components(const host::Application& application,
                     const std::vector<host::ComponentNews>& news, bool with_buckets,
                     protocol::Overview& overview) {
  std::map<std::string, std::uint64_t> queued;
  for (const SeenTopic& seen : see_topics(application)) {
    for (const detail::Subscription* subscription : seen.subscriptions) {
      queued[subscription->component] += subscription->ledger().queued;
    }
  }
  std::map<std::string, std::vector<host::KnownCallback>> callbacks;
  application.look_at_topics([&](const detail::Topics& topics) {
    callbacks = host::find_callbacks(topics, application.components());
  });
  const std::vector<std::string> executors = application.executor_names();
  for (const auto& core : application.components()) {
    protocol::Component& said = *overview.add_components();
    said.set_name(core->name);
    said.set_library(core->description.library);
    said.set_class_name(core->description.class_name);
    said.set_executor(core->description.executor.empty() && !executors.empty()
                          ? executors.back()
                          : core->description.executor);
    said.set_process(core->description.process);
    said.set_state(application.runs_elsewhere(core->name) ? "elsewhere"
                   : application.is_replayed(core->name)  ? "replayed"
                                                          : host::to_word(core->state.load()));
    const detail::ActorStatistics& statistics = core->statistics;
    said.set_activations(statistics.activations.get());
    said.set_faults(statistics.faults.get());
    said.set_overruns(statistics.overruns.get());
    fill(statistics.callback, with_buckets, *said.mutable_callback());
    fill(statistics.lateness, with_buckets, *said.mutable_lateness());
    for (const host::KnownCallback& callback : callbacks[core->name]) {
      protocol::Callback& its = *said.add_callbacks();
      its.set_name(callback.name);
      its.set_kind(callback.kind);
      fill(*callback.run_time, false, *its.mutable_time());
    }
    said.set_queued(queued[core->name]);
    if (core->index < news.size()) {
      const host::ComponentNews& its = news[core->index];
      said.set_health(host::to_word(its.health));
      said.set_health_reason(its.health_reason);
      said.set_faults(std::max(said.faults(), its.faults));
      said.set_last_fault(its.last_fault);
      said.set_restarts(its.restarts);
      said.set_library(its.version.library);
      said.set_build_id(its.version.build_id);
      said.set_is_on_probation(its.version.is_on_probation);
      said.set_reloads(its.version.reloads);
      said.set_rollbacks(its.version.rollbacks);
      said.set_last_reload(base::to_utf8(its.version.last));
      if (its.elsewhere) {
        said.set_state(host::to_word(its.elsewhere->state));
        said.set_executor(its.elsewhere->executor);
        said.set_activations(its.elsewhere->activations);
        said.set_overruns(its.elsewhere->overruns);
        fill(its.elsewhere->callback, its.elsewhere->callback_buckets, with_buckets,
             *said.mutable_callback());
        fill(its.elsewhere->lateness, its.elsewhere->lateness_buckets, with_buckets,
             *said.mutable_lateness());
        said.clear_callbacks();
        for (const host::FiguresElsewhere::Callback& callback : its.elsewhere->callbacks) {
          protocol::Callback& one = *said.add_callbacks();
          one.set_name(callback.name);
          one.set_kind(callback.kind);
          fill(callback.run_time, *one.mutable_time());
        }
        for (const auto& one : its.elsewhere->subscriptions) {
          said.set_queued(said.queued() + one.ledger.queued);
        }
        if (!its.elsewhere->hang.empty()) {
          said.set_health("hangs");
          said.set_health_reason(its.elsewhere->hang);
        }
      }
    }
    said.set_busy_ns(static_cast<std::int64_t>(said.callback().mean_ns() *
                                               static_cast<double>(said.callback().count())));
    if (const std::string hang = core->hang(); !hang.empty()) {
      said.set_health("hangs");
      said.set_health_reason(hang);
    }
  }
}

std::vector<SeenTopic> see_topics(const host::Application& application) {
  std::vector<SeenTopic> seen;
  application.look_at_topics([&](const detail::Topics& topics) {
    seen.reserve(topics.all().size());
    for (const auto& [name, topic] : topics.all()) {
      SeenTopic& one = seen.emplace_back();
      one.topic = topic.get();
      one.type = topic->type;
      for (const auto& publisher : topic->publishers) {
        one.publishers.push_back(publisher.get());
      }
      for (const auto& subscription : topic->subscriptions) {
        one.subscriptions.push_back(subscription.get());
      }
    }
  });
  return seen;
}

void fill_topic(const host::Application& application, const SeenTopic& seen,
                const std::vector<host::ComponentNews>& news, bool with_buckets,
                protocol::Topic& topic) {
  topic.set_name(seen.topic->name);
  topic.set_type(seen.type);
  topic.set_latched(seen.topic->options.latched);
  topic.set_is_service(seen.topic->name.find(detail::kServiceMark) != std::string::npos);
  for (const detail::PublisherCore* publisher : seen.publishers) {
    topic.set_allocated(topic.allocated() + publisher->allocated());
    if (publisher->owner.name.starts_with(Voice::kName) && publisher->published() == 0) {
      continue;  // No tool has published anything.
    }
    protocol::Publisher& said = *topic.add_publishers();
    said.set_component(publisher->owner.name);
    said.set_id(publisher->id);
    said.set_published(publisher->published());
    said.set_last_publish_ns(base::to_ns(publisher->last_publish_time()));
    said.set_is_external(publisher->options.is_external && !publisher->is_imported);
    topic.set_published(topic.published() + said.published());
  }
  for (const detail::Subscription* subscription : seen.subscriptions) {
    protocol::Subscriber& said = *topic.add_subscribers();
    said.set_component(subscription->component);
    said.set_kind(host::to_word(subscription->kind));
    said.set_depth(subscription->depth);
    said.set_overflow(subscription->overflow == Overflow::kDropOldest ? "drop_oldest"
                                                                      : "drop_newest");
    fill(subscription->ledger(), *said.mutable_ledger());
    fill(subscription->latency, with_buckets, *said.mutable_latency());
    for (const host::UnmatchedReport& unmatched : host::find_unmatched(*subscription)) {
      said.add_unmatched(unmatched.text);
    }
    count_in(said, topic);
  }
  for (const host::ComponentNews& its : news) {
    if (!its.elsewhere) {
      continue;
    }
    for (const auto& one : its.elsewhere->subscriptions) {
      if (one.topic != seen.topic->name) {
        continue;
      }
      protocol::Subscriber& said = *topic.add_subscribers();
      said.set_component(application.components()[its.component]->name);
      said.set_kind(one.kind);
      said.set_depth(one.depth);
      said.set_overflow(one.drops_oldest ? "drop_oldest" : "drop_newest");
      fill(one.ledger, *said.mutable_ledger());
      fill(one.latency, one.latency_buckets, with_buckets, *said.mutable_latency());
      said.mutable_unmatched()->Add(one.unmatched.begin(), one.unmatched.end());
      count_in(said, topic);
    }
  }
}

void fill_service(const KnownService& service, bool with_schemas, protocol::Service& said) {
  said.set_name(service.name);
  said.set_component(service.component);
  said.set_request_type(service.request->GetTypeName());
  said.set_reply_type(service.reply->GetTypeName());
  if (service.feedback != nullptr) {
    said.set_feedback_type(service.feedback->GetTypeName());
  }
  for (const std::string& client : service.clients) {
    said.add_clients(client);
  }
  if (with_schemas) {
    said.set_request_schema(record::descriptor_set_of(*service.request->GetDescriptor()));
    said.set_reply_schema(record::descriptor_set_of(*service.reply->GetDescriptor()));
  }
}

}  // namespace fastcycle::inspect
