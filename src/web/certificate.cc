#include "web/certificate.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

namespace fastcycle::web {
namespace {

constexpr long kDay = 24L * 60 * 60;

template <auto kFree>
struct Free {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Bio = std::unique_ptr<BIO, Free<&BIO_free_all>>;
using Key = std::unique_ptr<EVP_PKEY, Free<&EVP_PKEY_free>>;
using X509Ptr = std::unique_ptr<X509, Free<&X509_free>>;

void need(bool is_done) {
  if (!is_done) {
    throw std::runtime_error("no certificate can be made: OpenSSL refuses");
  }
}

Bio make_memory() {
  Bio memory(::BIO_new(::BIO_s_mem()));
  need(memory != nullptr);
  return memory;
}

std::string text_of(BIO& memory) {
  char* begin = nullptr;
  const long size = BIO_get_mem_data(&memory, &begin);
  return {begin, static_cast<std::size_t>(size)};
}

bool is_address(const std::string& name) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return ::inet_pton(AF_INET, name.c_str(), bytes.data()) == 1 ||
         ::inet_pton(AF_INET6, name.c_str(), bytes.data()) == 1;
}

void add_extension(X509& certificate, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  ::X509V3_set_ctx(&context, &certificate, &certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = ::X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str());
  need(extension != nullptr);
  const bool is_added = ::X509_add_ext(&certificate, extension, -1) == 1;
  ::X509_EXTENSION_free(extension);
  need(is_added);
}

}  // namespace

Certificate make_certificate(const std::vector<std::string>& names) {
  const Key key(EVP_EC_gen("P-256"));
  const X509Ptr certificate(::X509_new());
  need(key != nullptr && certificate != nullptr);
  std::uint64_t serial = 0;
  need(::RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof(serial)) == 1);
  ::X509_set_version(certificate.get(), X509_VERSION_3);
  ::ASN1_INTEGER_set_uint64(::X509_get_serialNumber(certificate.get()), serial >> 1U);
  ::X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -kDay);  // Clocks may differ.
  ::X509_gmtime_adj(X509_getm_notAfter(certificate.get()), 90 * kDay);
  need(::X509_set_pubkey(certificate.get(), key.get()) == 1);
  X509_NAME* subject = ::X509_get_subject_name(certificate.get());
  constexpr std::string_view kName = "FastCycle live";
  need(::X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(kName.data()),
                                    static_cast<int>(kName.size()), -1, 0) == 1);
  need(::X509_set_issuer_name(certificate.get(), subject) == 1);
  std::string alternatives;
  for (const std::string& name : names) {
    alternatives += fmt::format("{}{}:{}", alternatives.empty() ? "" : ",",
                                is_address(name) ? "IP" : "DNS", name);
  }
  add_extension(*certificate, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(*certificate, NID_ext_key_usage, "serverAuth");
  if (!alternatives.empty()) {
    add_extension(*certificate, NID_subject_alt_name, alternatives);
  }
  need(::X509_sign(certificate.get(), key.get(), ::EVP_sha256()) != 0);

  const Bio chain = make_memory();
  const Bio secret = make_memory();
  need(::PEM_write_bio_X509(chain.get(), certificate.get()) == 1);
  need(::PEM_write_bio_PrivateKey(secret.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) ==
       1);
  return {.chain = text_of(*chain), .key = text_of(*secret)};
}

std::string fingerprint_of(std::string_view chain) {
  const Bio memory(::BIO_new_mem_buf(chain.data(), static_cast<int>(chain.size())));
  const X509Ptr certificate(::PEM_read_bio_X509(memory.get(), nullptr, nullptr, nullptr));
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  if (certificate == nullptr ||
      ::X509_digest(certificate.get(), ::EVP_sha256(), digest.data(), &size) != 1) {
    throw std::runtime_error("there is no certificate in it");
  }
  std::string text;
  for (unsigned i = 0; i < size; ++i) {
    text += fmt::format("{}{:02X}", i == 0 ? "" : ":", digest[i]);
  }
  return text;
}

}  // namespace fastcycle::web
